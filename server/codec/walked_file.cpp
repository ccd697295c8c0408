#include "server/codec/walked_file.h"

#include <algorithm>

#include "server/codec/draco_chunk.h"
#include "server/codec/formats.h"
#include "server/codec/glb_writer.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

// The parts of files that wait for their turn.
constexpr std::uint64_t kPartsPerThread = std::uint64_t{6} << 20;
// Measured: an encoder of blocks.
constexpr std::uint64_t kEncoderBytesPerTriangle = 150;

std::uint64_t threads() { return static_cast<std::uint64_t>(mesh::thread_count()); }

}  // namespace

bool is_walked(MeshFormat format, const MeshParameters& parameters) {
  if (format == MeshFormat::kStl) return true;
  // Plain ones are merged as they are.
  return format == MeshFormat::kGlb && (is_plain(parameters) || !parameters.merge) &&
         !parameters.distances && parameters.lods.size() <= 1;
}

std::uint32_t walked_depth(MeshFormat format, const MeshParameters& parameters,
                           const mesh::SurfaceSize& size) {
  if (format != MeshFormat::kGlb || is_plain(parameters)) return 0;
  const BlockCut cut(size.triangles, size.layers, kTrianglesPerBlock);
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(cut.depth, size.layers));
}

std::uint64_t walked_memory(MeshFormat format, const MeshParameters& parameters,
                            const mesh::SurfaceSize& size, bool has_spool) {
  if (format != MeshFormat::kGlb) return threads() * kPartsPerThread;
  const auto file = static_cast<std::uint64_t>(describe(format).bytes(size, parameters));
  if (is_plain(parameters)) return threads() * kPartsPerThread + (has_spool ? 0 : file);
  return threads() * std::min<std::uint64_t>(kTrianglesPerBlock, size.triangles) *
             kEncoderBytesPerTriangle +
         (has_spool ? 0 : file);
}

std::unique_ptr<WalkedFile> walked_file(const WalkedContent& content) {
  if (content.format != MeshFormat::kGlb) return walked_stl(content);
  return is_plain(content.provenance.parameters) ? walked_plain_glb(content) : walked_glb(content);
}

}  // namespace isomesh::codec
