// A spool in memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/mutex.h"
#include "proto/error.h"
#include "server/mesh/spool.h"

namespace isomesh::test {

// Can be full. Thread safe.
class MemorySpool : public mesh::Spool {
 public:
  explicit MemorySpool(std::size_t most = std::size_t{1} << 30) : most_(most) {}

  void write(std::uint64_t at, std::span<const std::byte> bytes) override {
    const Lock lock(mutex_);
    if (at + bytes.size() > most_) throw Error(ErrorCode::kOutOfSpace, "the spool is full");
    if (bytes_.size() < at + bytes.size()) bytes_.resize(at + bytes.size());
    std::ranges::copy(bytes, bytes_.begin() + static_cast<std::ptrdiff_t>(at));
  }
  void read(std::uint64_t at, std::span<std::byte> bytes) const override {
    const Lock lock(mutex_);
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), bytes.size(), bytes.begin());
  }

  std::size_t size() const { return bytes_.size(); }

 private:
  const std::size_t most_;
  mutable Mutex mutex_;
  std::vector<std::byte> bytes_;
};

}  // namespace isomesh::test
