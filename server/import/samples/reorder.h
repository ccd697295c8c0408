// Changes the order of a lattice's axes in memory.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

struct StoredLattice {
  const InputFile& file;
  std::uint64_t offset = 0;
  std::size_t bytes_per_sample = 1;
};

// Appends the samples to `target` with x running fastest, then y, then z. `dims` are the sizes
// along x, y and z. Uses bounded memory and reads the file once for each block of rows that fits.
// Throws Error kUnusableVolume if the file ends early.
void write_reordered(const StoredLattice& stored, const std::array<std::uint32_t, 3>& dims,
                     const StoredAxes& axes, ScratchFile& target);

}  // namespace isomesh::import
