#include "server/import/samples/vtk_blocks.h"

#include <lz4.h>
#include <lzma.h>

#include "server/volume/unusable.h"

namespace isomesh::import {
namespace {

std::uint64_t expand_lz4(std::span<const std::byte> stored, std::span<std::byte> target) {
  const int found = ::LZ4_decompress_safe(
      reinterpret_cast<const char*>(stored.data()), reinterpret_cast<char*>(target.data()),
      static_cast<int>(stored.size()), static_cast<int>(target.size()));
  return found < 0 ? 0 : static_cast<std::uint64_t>(found);
}

std::uint64_t expand_xz(std::span<const std::byte> stored, std::span<std::byte> target) {
  std::uint64_t memory = std::uint64_t{256} << 20;  // the strongest setting needs 65 MiB
  std::size_t from = 0;
  std::size_t to = 0;
  const lzma_ret result = ::lzma_stream_buffer_decode(
      &memory, 0, nullptr, reinterpret_cast<const std::uint8_t*>(stored.data()), &from,
      stored.size(), reinterpret_cast<std::uint8_t*>(target.data()), &to, target.size());
  return result == LZMA_OK && from == stored.size() ? to : 0;
}

}  // namespace

std::vector<std::byte> expanded_block(VtkCompression compression, std::span<const std::byte> stored,
                                      std::uint64_t bytes) {
  if (bytes > kLargestVtkBlock || stored.size() > 2 * kLargestVtkBlock) {
    volume::throw_unusable("A compressed block of the VTK array is too large.");
  }
  std::vector<std::byte> block(bytes);
  const std::uint64_t found =
      compression == VtkCompression::kLz4 ? expand_lz4(stored, block) : expand_xz(stored, block);
  if (found != bytes) {
    volume::throw_unusable("A compressed block of the VTK array is damaged or has the wrong size.");
  }
  return block;
}

}  // namespace isomesh::import
