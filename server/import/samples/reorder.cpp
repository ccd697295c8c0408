#include "server/import/samples/reorder.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

namespace isomesh::import {
namespace {

constexpr std::uint64_t kBlockBytes = std::uint64_t{64} << 20;

using Box = std::array<std::uint64_t, 3>;  // along x, y and z

// Planes or rows of the result that are made at a time.
struct Block {
  Box first = {0, 0, 0};
  Box size = {0, 0, 0};

  std::uint64_t samples() const { return size[0] * size[1] * size[2]; }
};

class Reorder {
 public:
  Reorder(const StoredLattice& stored, const std::array<std::uint32_t, 3>& dims,
          const StoredAxes& axes)
      : stored_(stored), axes_(axes) {
    std::uint64_t step = 1;
    for (const std::size_t axis : axes) {
      steps_[axis] = step;
      step *= dims[axis];
    }
  }

  // Reads runs along the axis that is stored fastest.
  void read(const Block& block, std::vector<std::byte>& target) {
    const std::size_t bytes = stored_.bytes_per_sample;
    const Box into = {1, block.size[0], block.size[0] * block.size[1]};
    const auto [fastest, middle, slowest] = axes_;
    target.resize(block.samples() * bytes);
    run_.resize(block.size[fastest] * bytes);
    for (std::uint64_t far = 0; far < block.size[slowest]; ++far) {
      for (std::uint64_t near = 0; near < block.size[middle]; ++near) {
        const std::uint64_t place = block.first[fastest] +
                                    (block.first[middle] + near) * steps_[middle] +
                                    (block.first[slowest] + far) * steps_[slowest];
        if (stored_.file.read(stored_.offset + place * bytes, run_) != run_.size()) {
          throw_unusable("The file ends before its last sample.");
        }
        std::byte* to = target.data() + (near * into[middle] + far * into[slowest]) * bytes;
        for (std::size_t at = 0; at < run_.size(); at += bytes) {
          std::memcpy(to, run_.data() + at, bytes);
          to += into[fastest] * bytes;
        }
      }
    }
  }

 private:
  const StoredLattice& stored_;
  StoredAxes axes_;
  Box steps_ = {0, 0, 0};
  std::vector<std::byte> run_;
};

}  // namespace

void write_reordered(const StoredLattice& stored, const std::array<std::uint32_t, 3>& dims,
                     const StoredAxes& axes, ScratchFile& target) {
  const std::uint64_t row = std::uint64_t{dims[0]} * stored.bytes_per_sample;
  const std::uint64_t rows = std::max<std::uint64_t>(kBlockBytes / row, 1);
  const std::uint64_t planes = std::max<std::uint64_t>(rows / dims[1], 1);
  const std::uint64_t rows_at_once = std::min<std::uint64_t>(rows, dims[1]);
  Reorder reorder(stored, dims, axes);
  std::vector<std::byte> block;
  for (std::uint64_t z = 0; z < dims[2]; z += planes) {
    for (std::uint64_t y = 0; y < dims[1]; y += rows_at_once) {
      reorder.read({{0, y, z},
                    {dims[0], std::min(rows_at_once, dims[1] - y), std::min(planes, dims[2] - z)}},
                   block);
      target.write(block);
    }
  }
}

}  // namespace isomesh::import
