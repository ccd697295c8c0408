#include "server/codec/glb_writer.h"

#include <bit>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <string>
#include <utility>

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "GLB is little-endian");

// glTF 2.0, section 4.4.
constexpr std::uint32_t kMagic = 0x46546C67;
constexpr std::uint32_t kVersion = 2;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;

void write_words(const Sink& sink, std::initializer_list<std::uint32_t> words) {
  sink(std::as_bytes(std::span(words.begin(), words.size())));
}

}  // namespace

void check_glb_size(std::size_t bytes, const MeshParameters& parameters) {
  if (bytes <= std::numeric_limits<std::uint32_t>::max()) return;
  throw Error(ErrorCode::kTooLarge,
              "The encoded surface exceeds the 4 GiB that a GLB file can hold. Set \"triangles\" "
              "to simplify it" +
                  std::string(parameters.glb_codec == GlbCodec::kDraco
                                  ? "."
                                  : ", or \"glb_codec\" to \"draco\" to compress it."));
}

void encode_glb_block(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                      const VertexData& data, const MeshParameters& parameters,
                      const mesh::Context& context, std::size_t number, GlbLevel& level) {
  if (parameters.glb_codec != GlbCodec::kDraco) {
    level.arrays[number] = encode_arrays(mesh, block, grid, data, parameters.glb_codec);
    return;
  }
  Encoders& encoders = Encoders::instance();
  auto encoder = encoders.take(kTrianglesPerBlock);
  level.streams[number] =
      encoder->encode_block(mesh, block, {grid, parameters.draco.speed}, data, context);
  encoders.give_back(std::move(encoder));
}

void write_glb(std::span<const GlbPart> parts, const Grid& grid, const Provenance& provenance,
               const mesh::Context& context, const Sink& sink) {
  const GlbLayout layout(parts);
  const std::size_t binary_bytes = layout.bytes();
  std::string json = glb_document(parts, layout, grid, provenance);
  json.resize(glb_padded(json.size()), ' ');

  const std::size_t total = kHeaderBytes + kChunkHeaderBytes + json.size() +
                            (binary_bytes == 0 ? 0 : kChunkHeaderBytes + binary_bytes);
  check_glb_size(total, provenance.parameters);
  write_words(sink, {kMagic, kVersion, static_cast<std::uint32_t>(total)});
  write_words(sink, {static_cast<std::uint32_t>(json.size()), kJsonChunk});
  sink(std::as_bytes(std::span(json)));
  if (binary_bytes == 0) return;
  write_words(sink, {static_cast<std::uint32_t>(binary_bytes), kBinaryChunk});
  std::size_t written = 0;
  const Sink counted = [&](std::span<const std::byte> bytes) {
    sink(bytes);
    written += bytes.size();
    if (context.progress) {
      context.progress(static_cast<double>(written) / static_cast<double>(binary_bytes));
    }
  };
  for (const GlbLevel* level : layout.order()) level->put(counted);
  if (written != binary_bytes) {
    throw Error(ErrorCode::kInternal, "the arrays of a GLB file have other sizes than it tells");
  }
}

}  // namespace isomesh::codec
