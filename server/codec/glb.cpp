#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/codec/encoders.h"
#include "server/mesh/normals.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "GLB is little-endian");

// Measured: of half as many, the vertices that blocks share cost 1.5 % more bytes; of twice as
// many, the first come later and their vertices no longer have 16 bits.
constexpr std::size_t kTrianglesPerBlock = 100'000;
constexpr std::size_t kAlignment = 4;
constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";
// Of glTF's specification, sections 3.4 and 3.6.2.
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr std::uint32_t kMagic = 0x46546C67;
constexpr std::uint32_t kVersion = 2;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;

std::vector<DracoStream> encode_chunks(const mesh::Mesh& mesh, const MeshParameters& parameters,
                                       const mesh::Context& context) {
  const DracoParameters& draco = parameters.draco;
  const DracoOptions options = {grid_of(mesh, draco.position_bits), draco.speed};
  const mesh::Context quiet = {context.stop, nullptr};
  // Of the whole mesh, so that they are the same on both sides of a seam.
  mesh::Buffer<mesh::Vec3> normals;
  if (parameters.normals) vertex_normals(mesh, quiet, normals);
  const std::vector<Block> blocks = cut_blocks(mesh, kTrianglesPerBlock);
  std::vector<DracoStream> chunks(blocks.size());
  Encoders& encoders = Encoders::instance();
  mesh::parallel_for(context, blocks.size(), [&](std::size_t i) {
    auto encoder = encoders.take(kTrianglesPerBlock);
    chunks[i] = encoder->encode_block(mesh, blocks[i], options, normals.span(), quiet);
    encoders.give_back(std::move(encoder));
  });
  return chunks;
}

std::size_t padded(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

// One primitive, with the accessors and the buffer view that it names.
void add_primitive(Json& gltf, const DracoStream& chunk, std::size_t offset, bool normals) {
  const std::size_t view = gltf["bufferViews"].size();
  gltf["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", chunk.bytes.size()}});
  const std::size_t accessor = gltf["accessors"].size();
  gltf["accessors"].push_back({{"componentType", kFloat},
                               {"count", chunk.vertices},
                               {"type", "VEC3"},
                               {"min", chunk.low},
                               {"max", chunk.high}});
  gltf["accessors"].push_back({{"componentType", kUnsignedInt},
                               {"count", std::size_t{chunk.triangles} * 3},
                               {"type", "SCALAR"}});
  Json accessors = {{"POSITION", accessor}};
  Json attributes = {{"POSITION", chunk.position_id}};
  if (normals) {
    accessors["NORMAL"] = accessor + 2;
    attributes["NORMAL"] = chunk.normal_id;
    gltf["accessors"].push_back(
        {{"componentType", kFloat}, {"count", chunk.vertices}, {"type", "VEC3"}});
  }
  gltf["meshes"][0]["primitives"].push_back(
      {{"attributes", accessors},
       {"indices", accessor + 1},
       {"material", 0},
       {"extensions", {{kDracoExtension, {{"bufferView", view}, {"attributes", attributes}}}}}});
}

Json parameters_of(const Provenance& provenance) {
  Json parameters = {{"volume", provenance.volume}};
  parameters.update(Json::parse(to_json(provenance.parameters)));
  return parameters;
}

Json describe(const std::vector<DracoStream>& chunks, std::size_t binary_bytes,
              const Provenance& provenance) {
  Json gltf;
  gltf["asset"] = {{"version", "2.0"},
                   {"generator", "isomesh"},
                   {"extras",
                    {{"parameters", parameters_of(provenance)},
                     {"iso", provenance.iso},
                     {"dims", provenance.dims},
                     {"spacing", provenance.geometry.spacing},
                     {"origin", provenance.geometry.origin},
                     {"direction", provenance.geometry.direction},
                     {"units", "mm"},
                     {"space", "LPS"}}}};
  // Only where there are some: the meshes of other volumes keep their bytes.
  for (const Note& note : provenance.notes) {
    gltf["asset"]["extras"]["notes"].push_back({{"code", note.code}, {"detail", note.detail}});
  }
  gltf["scene"] = 0;
  gltf["scenes"] = Json::array({{{"nodes", {0}}}});
  // Positions are LPS millimetres; glTF wants metres, Y up and the front towards +Z: a quarter turn
  // about x takes S to +Y and A to +Z.
  constexpr double kMetresPerMillimetre = 0.001;
  constexpr double kHalfSqrt2 = 0.70710678118654752;
  Json node = {{"name", "surface"},
               {"rotation", {-kHalfSqrt2, 0, 0, kHalfSqrt2}},
               {"scale", {kMetresPerMillimetre, kMetresPerMillimetre, kMetresPerMillimetre}}};
  if (!chunks.empty()) {
    node["mesh"] = 0;
    gltf["meshes"] = Json::array({{{"name", "surface"}, {"primitives", Json::array()}}});
    gltf["materials"] = Json::array({{{"name", "neutral"},
                                      {"pbrMetallicRoughness",
                                       {{"baseColorFactor", {0.8, 0.8, 0.8, 1}},
                                        {"metallicFactor", 0},
                                        {"roughnessFactor", 0.6}}}}});
    gltf["accessors"] = Json::array();
    gltf["bufferViews"] = Json::array();
    gltf["buffers"] = Json::array({{{"byteLength", binary_bytes}}});
    gltf["extensionsUsed"] = {kDracoExtension};
    gltf["extensionsRequired"] = {kDracoExtension};
    std::size_t offset = 0;
    for (const DracoStream& chunk : chunks) {
      add_primitive(gltf, chunk, offset, provenance.parameters.normals);
      offset += padded(chunk.bytes.size());
    }
  }
  gltf["nodes"] = Json::array({node});
  return gltf;
}

void write_words(const Sink& sink, std::initializer_list<std::uint32_t> words) {
  sink(std::as_bytes(std::span(words.begin(), words.size())));
}

}  // namespace

std::optional<mesh::Topology> encode_glb(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink) {
  std::vector<DracoStream> chunks = encode_chunks(mesh, provenance.parameters, context);
  std::size_t binary_bytes = 0;
  for (const DracoStream& chunk : chunks) binary_bytes += padded(chunk.bytes.size());
  std::string json = describe(chunks, binary_bytes, provenance).dump();
  json.resize(padded(json.size()), ' ');

  constexpr std::size_t kHeaderBytes = 12;
  constexpr std::size_t kChunkHeaderBytes = 8;
  const std::size_t total = kHeaderBytes + kChunkHeaderBytes + json.size() +
                            (chunks.empty() ? 0 : kChunkHeaderBytes + binary_bytes);
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "the encoded surface exceeds the 4 GiB of a GLB file");
  }
  write_words(sink, {kMagic, kVersion, static_cast<std::uint32_t>(total)});
  write_words(sink, {static_cast<std::uint32_t>(json.size()), kJsonChunk});
  sink(std::as_bytes(std::span(json)));
  if (chunks.empty()) return std::nullopt;
  write_words(sink, {static_cast<std::uint32_t>(binary_bytes), kBinaryChunk});
  constexpr std::array<std::byte, kAlignment> kZeros = {};
  for (const DracoStream& chunk : chunks) {
    sink(chunk.bytes);
    sink(std::span(kZeros).first(padded(chunk.bytes.size()) - chunk.bytes.size()));
  }
  return topology_of(mesh, chunks, {context.stop, nullptr});
}

}  // namespace isomesh::codec
