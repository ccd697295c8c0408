#include "server/codec/glb_document.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "proto/json_tree.h"
#include "server/codec/provenance_json.h"

namespace isomesh::codec {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";
constexpr const char* kQuantizationExtension = "KHR_mesh_quantization";
constexpr const char* kLodExtension = "MSFT_lod";
constexpr const char* kManifoldExtension = "EXT_mesh_manifold";
// glTF 2.0, sections 3.4 and 3.6.2.
constexpr int kByte = 5120;
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;

// The extension that compresses arrays; null if they are raw.
const char* meshopt_extension(GlbCodec codec) {
  if (codec == GlbCodec::kMeshopt) return "EXT_meshopt_compression";
  return codec == GlbCodec::kKhrMeshopt ? "KHR_meshopt_compression" : nullptr;
}

bool has_steps(const Grid& grid, GlbCodec codec) {
  return codec != GlbCodec::kDraco && codec != GlbCodec::kNone && is_on_steps(grid);
}

// The extensions that readers must support.
std::vector<const char*> required_extensions(const Grid& grid, const MeshParameters& parameters) {
  const GlbCodec codec = parameters.glb_codec;
  if (codec == GlbCodec::kNone) return {};
  if (codec == GlbCodec::kDraco) return {kDracoExtension};
  std::vector<const char*> required;
  if (const char* const extension = meshopt_extension(codec)) required.push_back(extension);
  const bool is_quantized = has_steps(grid, codec) || parameters.normals;
  if (is_quantized) required.push_back(kQuantizationExtension);
  return required;
}

// Adds a primitive to the last mesh, with its accessors and its buffer view.
void add_primitive(Json& gltf, const DracoStream& chunk, std::size_t offset,
                   const MeshParameters& parameters) {
  const std::size_t view = gltf["bufferViews"].size();
  gltf["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", chunk.size()}});
  const std::size_t accessor = gltf["accessors"].size();
  gltf["accessors"].push_back({{"componentType", kFloat},
                               {"count", chunk.vertices},
                               {"type", "VEC3"},
                               {"min", chunk.bounds.low},
                               {"max", chunk.bounds.high}});
  gltf["accessors"].push_back({{"componentType", kUnsignedInt},
                               {"count", std::size_t{chunk.triangles} * 3},
                               {"type", "SCALAR"}});
  Json accessors = {{"POSITION", accessor}};
  Json attributes = {{"POSITION", chunk.position_id}};
  const auto add = [&](const char* name, std::uint32_t id, const char* type) {
    accessors[name] = gltf["accessors"].size();
    attributes[name] = id;
    gltf["accessors"].push_back(
        {{"componentType", kFloat}, {"count", chunk.vertices}, {"type", type}});
  };
  if (parameters.normals) add("NORMAL", chunk.normal_id, "VEC3");
  if (parameters.distances) add(kDistanceAttribute, chunk.distance_id, "SCALAR");
  gltf["meshes"].back()["primitives"].push_back(
      {{"attributes", accessors},
       {"indices", accessor + 1},
       {"material", gltf["materials"].size() - 1},
       {"extensions", {{kDracoExtension, {{"bufferView", view}, {"attributes", attributes}}}}}});
}

// Adds one array of the last chunk as a buffer view and returns its index. A view of a compressed
// array lies in the second buffer, which has no data; readers decompress it from the first.
std::size_t add_view(Json& gltf, const GlbArray& array, std::size_t offset, GlbCodec codec) {
  const bool is_indices = array.kind == GlbArray::Kind::kIndices;
  const char* const extension = meshopt_extension(codec);
  Json view = {{"buffer", 0}, {"byteOffset", offset + array.begin}, {"byteLength", array.bytes}};
  Json packed;
  if (extension != nullptr) {
    packed = view;
    packed["byteStride"] = array.stride;
    packed["count"] = array.count;
    packed["mode"] = is_indices ? "TRIANGLES" : "ATTRIBUTES";
    if (array.kind == GlbArray::Kind::kNormals) packed["filter"] = "OCTAHEDRAL";
    const std::size_t bytes = array.count * array.stride;
    Json& unpacked = gltf["buffers"][1]["byteLength"];
    const auto begin = unpacked.get<std::size_t>();
    unpacked = begin + glb_padded(bytes);
    view = {{"buffer", 1}, {"byteOffset", begin}, {"byteLength", bytes}};
  }
  if (!is_indices) view["byteStride"] = array.stride;
  view["target"] = is_indices ? kElementArrayBuffer : kArrayBuffer;
  if (extension != nullptr) view["extensions"] = {{extension, packed}};
  gltf["bufferViews"].push_back(std::move(view));
  return gltf["bufferViews"].size() - 1;
}

void add_primitive(Json& gltf, const ArrayChunk& chunk, std::size_t offset, GlbCodec codec) {
  Json attributes = Json::object();
  std::size_t indices = 0;
  for (const GlbArray& array : chunk.arrays) {
    const std::size_t number = gltf["accessors"].size();
    Json accessor = {{"bufferView", add_view(gltf, array, offset, codec)}};
    const auto describe = [&](int type, const char* shape) {
      accessor["componentType"] = type;
      accessor["count"] = array.count;
      accessor["type"] = shape;
    };
    const bool is_vector_of_floats = array.stride == sizeof(mesh::Vec3);
    switch (array.kind) {
      case GlbArray::Kind::kPositions:
        describe(is_vector_of_floats ? kFloat : kUnsignedShort, "VEC3");
        accessor["min"] = chunk.bounds.low;
        accessor["max"] = chunk.bounds.high;
        attributes["POSITION"] = number;
        break;
      case GlbArray::Kind::kNormals:
        describe(is_vector_of_floats ? kFloat : kByte, "VEC3");
        if (!is_vector_of_floats) accessor["normalized"] = true;
        attributes["NORMAL"] = number;
        break;
      case GlbArray::Kind::kDistances:
        describe(kFloat, "SCALAR");
        attributes[kDistanceAttribute] = number;
        break;
      case GlbArray::Kind::kIndices:
        describe(array.stride == sizeof(std::uint16_t) ? kUnsignedShort : kUnsignedInt, "SCALAR");
        indices = number;
        break;
    }
    gltf["accessors"].push_back(std::move(accessor));
  }
  gltf["meshes"].back()["primitives"].push_back({{"attributes", attributes},
                                                 {"indices", indices},
                                                 {"material", gltf["materials"].size() - 1}});
}

// Says of the last mesh that its only primitive is an oriented manifold without a boundary.
void mark_as_solid(Json& gltf) {
  constexpr int kTriangles = 4;
  Json& mesh = gltf["meshes"].back();
  const Json& primitive = mesh["primitives"][0];
  const Json solid = {{"attributes", {{"POSITION", primitive["attributes"]["POSITION"]}}},
                      {"indices", primitive["indices"]},
                      {"mode", kTriangles}};
  mesh["extensions"] = {{kManifoldExtension, {{"manifoldPrimitive", solid}}}};
}

Json asset_of(const Provenance& provenance) {
  return {{"version", "2.0"}, {"generator", "isomesh"}, {"extras", provenance_json(provenance)}};
}

// Positions are LPS millimetres; glTF has metres, Y up and the front towards +Z. A quarter turn
// about x maps S to +Y and A to +Z.
constexpr double kMetresPerMillimetre = 0.001;

Json turned_node(const std::string& name) {
  constexpr double kHalfSqrt2 = 0.70710678118654752;
  return {{"name", name},
          {"rotation", {-kHalfSqrt2, 0, 0, kHalfSqrt2}},
          {"scale", {kMetresPerMillimetre, kMetresPerMillimetre, kMetresPerMillimetre}}};
}

// Transforms grid steps to LPS millimetres, if positions are steps.
class Steps {
 public:
  Steps(const Grid& grid, const MeshParameters& parameters)
      : are_used_(has_steps(grid, parameters.glb_codec)),
        low_{grid.low[0], grid.low[1], grid.low[2]},
        step_(double{grid.side} / (std::exp2(grid.bits) - 1)) {}

  // For a node without another transformation.
  void put_into(Json& node) const {
    if (!are_used_) return;
    node["translation"] = low_;
    node["scale"] = {step_, step_, step_};
  }

  // For the root node, before its rotation.
  void put_into_turned(Json& node) const {
    if (!are_used_) return;
    const double scale = step_ * kMetresPerMillimetre;
    const auto [x, y, z] = low_;
    node["translation"] = {x * kMetresPerMillimetre, z * kMetresPerMillimetre,
                           -y * kMetresPerMillimetre};
    node["scale"] = {scale, scale, scale};
  }

 private:
  bool are_used_;
  std::array<double, 3> low_;
  double step_;
};

Json material_of(const GlbPart& part) {
  const auto& [red, green, blue] = part.color;
  return {{"name", part.material},
          {"pbrMetallicRoughness",
           {{"baseColorFactor", {red, green, blue, 1}},
            {"metallicFactor", 0},
            {"roughnessFactor", 0.6}}}};
}

// Adds a mesh with its primitives, using the last material.
void add_mesh(Json& gltf, const std::string& name, const GlbLevel& level, std::size_t offset,
              const MeshParameters& parameters) {
  gltf["meshes"].push_back({{"name", name}, {"primitives", Json::array()}});
  for (const DracoStream& chunk : level.streams) {
    add_primitive(gltf, chunk, offset, parameters);
    offset += glb_padded(chunk.size());
  }
  for (const ArrayChunk& chunk : level.arrays) {
    add_primitive(gltf, chunk, offset, parameters.glb_codec);
    offset += chunk.size();
  }
  if (level.is_solid) mark_as_solid(gltf);
}

Json extras_of(const LabelSummary& label) {
  Json number;
  json_values::assign(number, label.label);
  Json extras = {{"label", number}, {"voxels", label.voxels}};
  if (label.encloses_volume()) extras["volume_mm3"] = label.volume_mm3;
  extras["area_mm2"] = label.area_mm2;
  return extras;
}

// For each level, the smallest fraction of the screen's height or width at which it is drawn. There
// the next level has as many triangles per screen area as the finest has at full screen. The last
// level is always drawn.
Json screen_coverage(const GlbPart& part) {
  Json coverage = Json::array();
  for (std::size_t level = 1; level < part.levels.size(); ++level) {
    coverage.push_back(part.levels[level].share);
  }
  coverage.push_back(0);
  return coverage;
}

// All nodes: the root, its children, and then the coarser levels. Those are not children of a node;
// MSFT_lod refers to them.
class Nodes {
 public:
  Nodes(Json& gltf, const GlbLayout& layout, const MeshParameters& parameters)
      : gltf_(gltf), layout_(layout), parameters_(parameters) {}

  // Completes a part's node with its meshes. Nodes of coarser levels start at index `levels_from`;
  // they differ from the node in name and mesh only. Empty parts have no mesh.
  Json node_of(const GlbPart& part, std::size_t number, Json node, std::size_t levels_from) {
    const Json bare = node;
    if (part.label) node["extras"] = extras_of(*part.label);
    if (part.levels.empty()) return node;
    node["mesh"] = gltf_["meshes"].size();
    gltf_["materials"].push_back(material_of(part));
    add_mesh(gltf_, part.name, part.levels[0], layout_.begin(number, 0), parameters_);
    if (part.levels.size() == 1) return node;
    Json ids = Json::array();
    for (std::size_t level = 1; level < part.levels.size(); ++level) {
      const std::string name = part.name + ", level " + std::to_string(level + 1);
      Json coarser = bare;
      coarser["name"] = name;
      coarser["mesh"] = gltf_["meshes"].size();
      add_mesh(gltf_, name, part.levels[level], layout_.begin(number, level), parameters_);
      ids.push_back(levels_from + levels_.size());
      levels_.push_back(std::move(coarser));
    }
    node["extensions"] = {{kLodExtension, {{"ids", ids}}}};
    node["extras"]["MSFT_screencoverage"] = screen_coverage(part);
    return node;
  }

  const std::vector<Json>& levels() const { return levels_; }

 private:
  Json& gltf_;
  const GlbLayout& layout_;
  const MeshParameters& parameters_;
  std::vector<Json> levels_;
};

// Lists the extensions of the file, and adds the buffer that compressed arrays are unpacked to.
void add_extensions(Json& gltf, const GlbLayout& layout, const Grid& grid,
                    const MeshParameters& parameters) {
  const std::vector<const char*> required = required_extensions(grid, parameters);
  if (!required.empty()) {
    gltf["extensionsUsed"] = required;
    gltf["extensionsRequired"] = required;
  }
  if (std::ranges::any_of(layout.order(), &GlbLevel::is_solid)) {
    gltf["extensionsUsed"].push_back(kManifoldExtension);
  }
  if (const char* const extension = meshopt_extension(parameters.glb_codec)) {
    gltf["buffers"].push_back(
        {{"byteLength", 0}, {"extensions", {{extension, {{"fallback", true}}}}}});
  }
}

}  // namespace

void GlbLevel::put(const Sink& sink) const {
  constexpr std::array<std::byte, kGlbAlignment> kZeros = {};
  for (const DracoStream& stream : streams) {
    const std::size_t bytes = stream.bytes.size();
    if (bytes == 0) continue;
    sink(stream.bytes);
    sink(std::span(kZeros).first(glb_padded(bytes) - bytes));
  }
  for (const ArrayChunk& chunk : arrays) {
    if (!chunk.bytes.empty()) sink(chunk.bytes);
  }
  if (put_others) put_others(sink);
}

GlbLayout::GlbLayout(std::span<const GlbPart> parts) : begins_(parts.size()) {
  std::size_t most_levels = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    begins_[p].resize(parts[p].levels.size());
    most_levels = std::max(most_levels, parts[p].levels.size());
  }
  for (std::size_t level = most_levels; level-- > 0;) {
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (level >= parts[p].levels.size()) continue;
      begins_[p][level] = bytes_;
      order_.push_back(&parts[p].levels[level]);
      bytes_ += order_.back()->bytes();
    }
  }
}

std::string glb_document(std::span<const GlbPart> parts, const GlbLayout& layout, const Grid& grid,
                         const Provenance& provenance) {
  const Steps steps(grid, provenance.parameters);
  Json gltf;
  gltf["asset"] = asset_of(provenance);
  gltf["scene"] = 0;
  gltf["scenes"] = Json::array({{{"nodes", {0}}}});
  if (layout.bytes() > 0) {
    for (const char* list : {"meshes", "materials", "accessors", "bufferViews"}) {
      gltf[list] = Json::array();
    }
    gltf["buffers"] = Json::array({{{"byteLength", layout.bytes()}}});
    add_extensions(gltf, layout, grid, provenance.parameters);
  }
  Nodes nodes(gltf, layout, provenance.parameters);
  Json all = Json::array();
  if (!provenance.parameters.labels) {
    Json node = turned_node("surface");
    steps.put_into_turned(node);
    all.push_back(nodes.node_of(parts.front(), 0, std::move(node), 1));
  } else {
    Json root = turned_node("labels");
    all.push_back(nullptr);
    for (std::size_t n = 0; n < parts.size(); ++n) {
      root["children"].push_back(all.size());
      Json node = {{"name", parts[n].name}};
      steps.put_into(node);
      all.push_back(nodes.node_of(parts[n], n, std::move(node), parts.size() + 1));
    }
    all[0] = root;
  }
  for (const Json& level : nodes.levels()) all.push_back(level);
  if (!nodes.levels().empty()) gltf["extensionsUsed"].push_back(kLodExtension);
  gltf["nodes"] = all;
  return dump(gltf);
}

}  // namespace isomesh::codec
