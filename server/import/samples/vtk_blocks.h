// The compressed blocks of VTK's XML files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/import/source/source.h"

namespace isomesh::import {

// A block as vtkLZ4DataCompressor (one block of LZ4) or vtkLZMADataCompressor (one .xz stream)
// leaves it. Returns what it holds: `bytes`, at most kLargestVtkBlock. Throws Error
// kUnusableVolume when it is damaged or holds more or less.
std::vector<std::byte> expanded_block(VtkCompression compression, std::span<const std::byte> stored,
                                      std::uint64_t bytes);

// Such blocks are expanded in memory. VTK itself makes blocks of some 32 KiB.
inline constexpr std::uint64_t kLargestVtkBlock = std::uint64_t{64} << 20;

}  // namespace isomesh::import
