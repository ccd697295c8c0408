#pragma once

#include <cstddef>
#include <span>
#include <utility>

namespace isomesh {

// Owns a descriptor; -1 is none. Not thread safe.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int number() const { return number_; }
  int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

// Writes all of `bytes`. Throws Error kOutOfSpace or kInternal.
void write_all(const Descriptor& file, std::span<const std::byte> bytes);

// Opens /dev/null for each of the descriptors 0 to 2 that is closed; otherwise the next opened file
// would get its number, and what is meant for standard output would go there. Reading 0 and writing
// to 1 then still fail; text for 2 is discarded. Call it first in main.
void hold_standard_descriptors();

}  // namespace isomesh
