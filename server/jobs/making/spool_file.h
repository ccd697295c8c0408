#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>

#include "base/descriptor.h"
#include "server/mesh/spool.h"

namespace isomesh::jobs {

// A file without a name. Thread safe.
class SpoolFile : public mesh::Spool {
 public:
  // Makes one in the folder. Throws Error kOutOfSpace or kInternal.
  explicit SpoolFile(const std::filesystem::path& folder);
  // Takes one that is open for both.
  explicit SpoolFile(Descriptor file) : file_(std::move(file)) {}

  // Throws Error kOutOfSpace if the disk is full, kTooLarge at the limit of the process, and
  // kInternal.
  void write(std::uint64_t at, std::span<const std::byte> bytes) override;
  // Throws Error kInternal.
  void read(std::uint64_t at, std::span<std::byte> bytes) const override;
  // Gives the disk back what has been written.
  void clear();

 private:
  Descriptor file_;
};

}  // namespace isomesh::jobs
