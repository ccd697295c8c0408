#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"
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

// One surface, with a material and a node of its own.
struct Part {
  std::string name;
  std::string material;
  std::array<double, 3> color = {0.8, 0.8, 0.8};  // linear
  Json extras = {};                               // of the node; none where it is null
  std::vector<DracoStream> chunks = {};
};

std::vector<DracoStream> encode_chunks(const mesh::Mesh& mesh, const Grid& grid,
                                       const MeshParameters& parameters,
                                       const mesh::Context& context) {
  const DracoOptions options = {grid, parameters.draco.speed};
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

// One primitive of the last mesh, with the accessors and the buffer view that it names.
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
  gltf["meshes"].back()["primitives"].push_back(
      {{"attributes", accessors},
       {"indices", accessor + 1},
       {"material", gltf["materials"].size() - 1},
       {"extensions", {{kDracoExtension, {{"bufferView", view}, {"attributes", attributes}}}}}});
}

Json parameters_of(const Provenance& provenance) {
  Json parameters = {{"volume", provenance.volume}};
  parameters.update(Json::parse(to_json(provenance.parameters)));
  return parameters;
}

std::size_t bytes_of(const Part& part) {
  std::size_t bytes = 0;
  for (const DracoStream& chunk : part.chunks) bytes += padded(chunk.bytes.size());
  return bytes;
}

Json asset_of(const Provenance& provenance) {
  Json extras = {{"parameters", parameters_of(provenance)}};
  if (!provenance.parameters.labels) extras["iso"] = provenance.iso;
  extras.update({{"dims", provenance.dims},
                 {"spacing", provenance.geometry.spacing},
                 {"origin", provenance.geometry.origin},
                 {"direction", provenance.geometry.direction},
                 {"units", "mm"},
                 {"space", "LPS"}});
  // Only where there are some: the meshes of other volumes keep their bytes.
  for (const Note& note : provenance.notes) {
    extras["notes"].push_back({{"code", note.code}, {"detail", note.detail}});
  }
  return {{"version", "2.0"}, {"generator", "isomesh"}, {"extras", extras}};
}

// Positions are LPS millimetres; glTF wants metres, Y up and the front towards +Z: a quarter turn
// about x takes S to +Y and A to +Z.
Json turned_node(const std::string& name) {
  constexpr double kMetresPerMillimetre = 0.001;
  constexpr double kHalfSqrt2 = 0.70710678118654752;
  return {{"name", name},
          {"rotation", {-kHalfSqrt2, 0, 0, kHalfSqrt2}},
          {"scale", {kMetresPerMillimetre, kMetresPerMillimetre, kMetresPerMillimetre}}};
}

Json material_of(const Part& part) {
  const auto& [red, green, blue] = part.color;
  return {{"name", part.material},
          {"pbrMetallicRoughness",
           {{"baseColorFactor", {red, green, blue, 1}},
            {"metallicFactor", 0},
            {"roughnessFactor", 0.6}}}};
}

// Adds the part's mesh and all that it names, and says in `node` which it is. Empty ones have none.
void add_part(Json& gltf, const Part& part, std::size_t& offset, bool normals, Json& node) {
  if (!part.extras.is_null()) node["extras"] = part.extras;
  if (part.chunks.empty()) return;
  node["mesh"] = gltf["meshes"].size();
  gltf["meshes"].push_back({{"name", part.name}, {"primitives", Json::array()}});
  gltf["materials"].push_back(material_of(part));
  for (const DracoStream& chunk : part.chunks) {
    add_primitive(gltf, chunk, offset, normals);
    offset += padded(chunk.bytes.size());
  }
}

// Of one surface, which is the turned node's own; or of one for each label, in nodes below it.
Json describe(std::span<const Part> parts, std::size_t binary_bytes, const Provenance& provenance) {
  Json gltf;
  gltf["asset"] = asset_of(provenance);
  gltf["scene"] = 0;
  gltf["scenes"] = Json::array({{{"nodes", {0}}}});
  if (binary_bytes > 0) {
    for (const char* list : {"meshes", "materials", "accessors", "bufferViews"}) {
      gltf[list] = Json::array();
    }
    gltf["buffers"] = Json::array({{{"byteLength", binary_bytes}}});
    gltf["extensionsUsed"] = {kDracoExtension};
    gltf["extensionsRequired"] = {kDracoExtension};
  }
  std::size_t offset = 0;
  const bool normals = provenance.parameters.normals;
  Json root = turned_node(provenance.parameters.labels ? "labels" : "surface");
  Json nodes = Json::array();
  if (!provenance.parameters.labels) {
    add_part(gltf, parts.front(), offset, normals, root);
  } else {
    for (const Part& part : parts) {
      Json node = {{"name", part.name}};
      add_part(gltf, part, offset, normals, node);
      nodes.push_back(node);
      root["children"].push_back(nodes.size());
    }
  }
  nodes.insert(nodes.begin(), root);
  gltf["nodes"] = nodes;
  return gltf;
}

void write_words(const Sink& sink, std::initializer_list<std::uint32_t> words) {
  sink(std::as_bytes(std::span(words.begin(), words.size())));
}

void write_glb(std::span<const Part> parts, const Provenance& provenance, const Sink& sink) {
  std::size_t binary_bytes = 0;
  for (const Part& part : parts) binary_bytes += bytes_of(part);
  std::string json = describe(parts, binary_bytes, provenance).dump();
  json.resize(padded(json.size()), ' ');

  constexpr std::size_t kHeaderBytes = 12;
  constexpr std::size_t kChunkHeaderBytes = 8;
  const std::size_t total = kHeaderBytes + kChunkHeaderBytes + json.size() +
                            (binary_bytes == 0 ? 0 : kChunkHeaderBytes + binary_bytes);
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "the encoded surface exceeds the 4 GiB of a GLB file");
  }
  write_words(sink, {kMagic, kVersion, static_cast<std::uint32_t>(total)});
  write_words(sink, {static_cast<std::uint32_t>(json.size()), kJsonChunk});
  sink(std::as_bytes(std::span(json)));
  if (binary_bytes == 0) return;
  write_words(sink, {static_cast<std::uint32_t>(binary_bytes), kBinaryChunk});
  constexpr std::array<std::byte, kAlignment> kZeros = {};
  for (const Part& part : parts) {
    for (const DracoStream& chunk : part.chunks) {
      sink(chunk.bytes);
      sink(std::span(kZeros).first(padded(chunk.bytes.size()) - chunk.bytes.size()));
    }
  }
}

// glTF's colours are linear, a screen's are not (IEC 61966-2-1).
double linear_of(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

Part part_of(const LabelSummary& label) {
  Part part = {.name = title_of(label), .material = title_of(label)};
  part.color = color_of(label);
  for (double& channel : part.color) channel = linear_of(channel);
  part.extras = {{"label", label.label},
                 {"voxels", label.voxels},
                 {"volume_mm3", label.volume_mm3},
                 {"area_mm2", label.area_mm2}};
  return part;
}

}  // namespace

std::optional<mesh::Topology> encode_glb(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink) {
  Part part = {.name = "surface", .material = "neutral"};
  const Grid grid = grid_of(mesh, provenance.parameters.draco.position_bits);
  part.chunks = encode_chunks(mesh, grid, provenance.parameters, context);
  write_glb({&part, 1}, provenance, sink);
  if (part.chunks.empty()) return std::nullopt;
  return topology_of(mesh, part.chunks, {context.stop, nullptr});
}

void encode_labels_glb(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink) {
  const Grid grid = grid_of(surface.walls.mesh, provenance.parameters.draco.position_bits);
  const mesh::Context quiet = {context.stop, nullptr};
  std::vector<Part> parts(surface.labels.size());
  mesh::parallel_for(context, parts.size(), [&](std::size_t n) {
    mesh::Mesh mesh;
    extract_label(surface.walls, surface.triangles, n + 1, mesh);
    parts[n] = part_of(surface.labels[n]);
    parts[n].chunks = encode_chunks(mesh, grid, provenance.parameters, quiet);
  });
  write_glb(parts, provenance, sink);
}

}  // namespace isomesh::codec
