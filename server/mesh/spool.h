#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace isomesh::mesh {

// Room for bytes that would take too much memory: a file without a name, or what stands in for it.
// Thread safe.
class Spool {
 public:
  virtual ~Spool() = default;

  // A place for so many bytes, which nobody else gets.
  std::uint64_t take(std::uint64_t bytes) { return end_.fetch_add(bytes); }

  // Throws Error kOutOfSpace if there is no room.
  virtual void write(std::uint64_t at, std::span<const std::byte> bytes) = 0;
  // Only what has been written.
  virtual void read(std::uint64_t at, std::span<std::byte> bytes) const = 0;

 protected:
  // Places are taken from the first again.
  void begin_again() { end_ = 0; }

 private:
  std::atomic<std::uint64_t> end_ = 0;
};

}  // namespace isomesh::mesh
