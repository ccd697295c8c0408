// Compressed blocks of VTK's XML files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/import/source/source.h"

namespace isomesh::import {

// Decompresses a block of vtkLZ4DataCompressor (one LZ4 block) or vtkLZMADataCompressor (one .xz
// stream). Returns `bytes` bytes, at most kLargestVtkBlock. Throws Error kUnusableVolume if it is
// damaged or has another size.
std::vector<std::byte> expanded_block(VtkCompression compression, std::span<const std::byte> stored,
                                      std::uint64_t bytes);

// Such blocks are decompressed in memory. VTK writes blocks of about 32 KiB.
inline constexpr std::uint64_t kLargestVtkBlock = std::uint64_t{64} << 20;

}  // namespace isomesh::import
