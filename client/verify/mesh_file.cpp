#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "client/verify/verify.h"
#include "proto/json_tree.h"
#include "proto/json_values.h"

namespace isomesh::verify {
namespace {

using namespace json_values;

static_assert(std::endian::native == std::endian::little, "the files are little-endian");

constexpr std::size_t kPoint = 3 * sizeof(float);
constexpr std::uint64_t kNone = UINT32_MAX;

[[noreturn]] void refuse(const std::string& reason) {
  throw Error(ErrorCode::kInvalidParameter, "the mesh cannot be read: " + reason);
}

// The surface before simplification, from which labels' bounds count, is not made here.
[[noreturn]] void refuse_labels() {
  throw Error(ErrorCode::kInvalidParameter,
              "the mesh is one of labels, which cannot be checked: its bound counts from the "
              "smoothed surface, and this program has the surface at an iso-value");
}

template <class T>
T at(std::string_view bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

void add_points(Surface& surface, std::string_view bytes) {
  for (std::size_t n = 0; n < bytes.size(); n += kPoint) {
    const auto [x, y, z] = at<std::array<float, 3>>(bytes, n);
    surface.points.push_back({x, y, z});
  }
}

// Its corners are the last three points.
void add_triangle(Surface& surface) {
  const auto end = static_cast<std::uint32_t>(surface.points.size());
  surface.triangles.push_back({end - 3, end - 2, end - 1});
}

Surface read_text_stl(std::string_view bytes) {
  const auto all = words(bytes.substr(std::min(bytes.find('\n'), bytes.size())));
  constexpr std::size_t kFacet = 21;  // words
  Surface surface;
  std::size_t n = 0;
  for (; n + kFacet < all.size() && all[n] == "facet"; n += kFacet) {
    for (std::size_t vertex = n + 7; vertex < n + 19; vertex += 4) {
      if (all[vertex] != "vertex") refuse("a facet of the STL lacks a vertex");
      const auto number = [&](std::size_t word) {
        return parse_double(all[vertex + word]).value_or(std::nan(""));
      };
      surface.points.push_back({number(1), number(2), number(3)});
    }
    add_triangle(surface);
  }
  if (n >= all.size() || all[n] != "endsolid") refuse("the STL is truncated or malformed");
  return surface;
}

Surface read_stl(std::string_view bytes) {
  constexpr std::size_t kHeader = 84;
  constexpr std::size_t kFacet = 50;
  if (bytes.size() < kHeader) refuse("it is too short for an STL, PLY or GLB file");
  const auto count = at<std::uint32_t>(bytes, kHeader - sizeof(std::uint32_t));
  const std::uint64_t size = kHeader + std::uint64_t{count} * kFacet;
  if (size != bytes.size()) {
    if (bytes.starts_with("solid")) return read_text_stl(bytes);
    refuse("it has " + std::to_string(bytes.size()) + " bytes, but an STL file of " +
           std::to_string(count) + " triangles has " + std::to_string(size));
  }
  Surface surface;
  for (std::size_t facet = kHeader; facet < size; facet += kFacet) {
    add_points(surface, bytes.substr(facet + kPoint, 3 * kPoint));
    add_triangle(surface);
  }
  return surface;
}

Surface read_ply(std::string_view bytes) {
  constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = bytes.find(kEnd);
  if (bytes.substr(0, end).find(" label\n") != bytes.npos) refuse_labels();
  std::string header;
  std::vector<std::uint64_t> counts;
  for (const std::string_view line : lines(bytes.substr(0, end))) {
    if (line.starts_with("comment")) continue;
    const bool is_element = line.starts_with("element ");
    const std::size_t number = is_element ? line.rfind(' ') + 1 : line.size();
    if (is_element) counts.push_back(parse_uint64(line.substr(number)).value_or(UINT64_MAX));
    header += std::string(line.substr(0, number)) + '\n';
  }
  if (end == bytes.npos || header !=
                               "ply\nformat binary_little_endian 1.0\nelement vertex \n"
                               "property float x\nproperty float y\nproperty float z\n"
                               "element face \nproperty list uchar uint vertex_indices\n") {
    refuse("the header of the PLY is not that of isomesh");
  }
  const std::string_view body = bytes.substr(end + kEnd.size());
  constexpr std::size_t kFace = 1 + sizeof(Indices);
  if (counts[0] > body.size() / kPoint || counts[1] > body.size() / kFace ||
      counts[0] * kPoint + counts[1] * kFace != body.size()) {
    refuse("the PLY has another size than its header says");
  }
  Surface surface;
  const std::size_t faces = counts[0] * kPoint;
  add_points(surface, body.substr(0, faces));
  for (std::size_t n = faces; n < body.size(); n += kFace) {
    if (body[n] != 3) refuse("a face of the PLY is no triangle");
    surface.triangles.push_back(at<Indices>(body, n + 1));
  }
  return surface;
}

const Json& item(const Json& array, std::uint64_t index) {
  if (index >= array_size(array)) refuse("the GLB names an object that it lacks");
  return element(array, index);
}

std::uint64_t number_in(const Json& json, const char* name, std::uint64_t standard) {
  const Json* found = find(json, name);
  return found != nullptr ? whole(*found, UINT32_MAX) : standard;
}

// The content of the first chunk, which is removed.
std::string_view take_chunk(std::string_view& bytes, std::string_view type) {
  constexpr std::size_t kHeader = 8;
  if (bytes.size() < kHeader || bytes.substr(4, 4) != type ||
      bytes.size() - kHeader < at<std::uint32_t>(bytes, 0)) {
    refuse("the GLB is truncated or malformed");
  }
  const std::string_view chunk = bytes.substr(kHeader, at<std::uint32_t>(bytes, 0));
  bytes.remove_prefix(kHeader + chunk.size());
  return chunk;
}

// The items of an accessor, without gaps.
std::string_view items(const Json& gltf, std::string_view binary, std::uint64_t index,
                       std::string_view shape, std::size_t bytes) {
  const Json& accessor = item(existing(gltf, "accessors"), index);
  const Json& view = item(existing(gltf, "bufferViews"), number_in(accessor, "bufferView", kNone));
  const auto begin = number_in(view, "byteOffset", 0) + number_in(accessor, "byteOffset", 0);
  const std::uint64_t size = bytes * number_in(accessor, "count", kNone);
  const std::uint64_t type = shape == "VEC3" ? 5126 : 5125;  // floats, or 32-bit indices
  if (text(existing(accessor, "type")) != shape ||
      number_in(accessor, "componentType", 0) != type ||
      number_in(view, "byteStride", bytes) != bytes || begin + size > binary.size()) {
    refuse("the GLB lacks bytes, or has other things than floats and 32-bit indices");
  }
  return binary.substr(begin, size);
}

bool is_of_labels(const Json& gltf) {
  const Json* json = &gltf;
  for (const char* const name : {"asset", "extras", "parameters", "labels"}) {
    json = is_object(*json) ? find(*json, name) : nullptr;
    if (json == nullptr) return false;
  }
  return !is_null(*json);
}

// The first chunk of the file, which is removed with all before it.
JsonTree take_json(std::string_view& bytes) {
  if (bytes.size() < 12 || at<std::uint32_t>(bytes, 8) != bytes.size()) {
    refuse("the GLB has another size than its header says");
  }
  bytes.remove_prefix(12);
  return JsonTree(take_chunk(bytes, "JSON"));
}

// The scene's only node turns millimetres in LPS into metres with Y up, and holds one primitive.
Surface read_glb(std::string_view bytes) {
  std::string_view rest = bytes;
  const JsonTree tree = take_json(rest);
  const Json& gltf = tree.root();
  Surface surface;
  if (is_of_labels(gltf)) refuse_labels();
  if (find(gltf, "extensionsRequired") != nullptr) refuse("the GLB has a codec; ask for none");
  const Json& nodes = existing(item(existing(gltf, "scenes"), 0), "nodes");
  if (array_size(nodes) == 0) return surface;
  const std::string_view binary = take_chunk(rest, std::string_view("BIN\0", 4));
  const Json& node = item(existing(gltf, "nodes"), whole(item(nodes, 0), kNone));
  const Json& mesh = item(existing(gltf, "meshes"), number_in(node, "mesh", kNone));
  const Json& primitives = existing(mesh, "primitives");
  if (array_size(nodes) + array_size(primitives) != 2) refuse("the GLB has several objects");
  const Json& attributes = existing(item(primitives, 0), "attributes");
  const auto points = items(gltf, binary, number_in(attributes, "POSITION", kNone), "VEC3", kPoint);
  const auto corners = items(gltf, binary, number_in(item(primitives, 0), "indices", kNone),
                             "SCALAR", sizeof(std::uint32_t));
  add_points(surface, points);
  for (std::size_t n = 0; n + sizeof(Indices) <= corners.size(); n += sizeof(Indices)) {
    surface.triangles.push_back(at<Indices>(corners, n));
  }
  return surface;
}

void join_equal_points(Surface& surface) {
  std::vector<std::uint32_t> order(surface.points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t point) { return surface.points[point]; });
  std::vector<std::uint32_t> joined(order.size());
  std::vector<Vec> points;
  for (const std::uint32_t point : order) {
    const Vec& place = surface.points[point];
    if (points.empty() || points.back() != place) points.push_back(place);
    joined[point] = static_cast<std::uint32_t>(points.size() - 1);
  }
  surface.points = std::move(points);
  for (auto& triangle : surface.triangles) {
    for (std::uint32_t& corner : triangle) {
      if (corner >= joined.size()) refuse("an index is beyond the vertices");
      corner = joined[corner];
    }
  }
}

// The reader of JSON leaves out the subject.
[[noreturn]] void refuse_glb(const Error& error) {
  if (error.code() == ErrorCode::kInvalidParameter) throw error;
  refuse(std::string("the GLB ") + error.what());
}

}  // namespace

std::optional<MeshParameters> read_parameters(std::string_view bytes) try {
  if (!bytes.starts_with("glTF")) return std::nullopt;
  JsonTree tree = take_json(bytes);
  const Json* const asset = find(tree.root(), "asset");
  const Json* const extras = asset == nullptr ? nullptr : find(*asset, "extras");
  if (extras == nullptr || find(*extras, "parameters") == nullptr) return std::nullopt;
  MeshParameters parameters;
  Json& told = member(member(member(tree.root(), "asset"), "extras"), "parameters");
  // A file does not say which others there were.
  write_field(told, rows::kFormats, parameters.formats);
  read_members(told, parameters);
  if (const Json* iso = find(*extras, "iso")) parameters.iso = number(*iso);
  return parameters;
} catch (const Error& error) {
  refuse_glb(error);
}

Surface read_surface(std::string_view bytes) try {
  const bool is_glb = bytes.starts_with("glTF");
  const bool is_ply = bytes.starts_with("ply\n");
  Surface surface = is_glb ? read_glb(bytes) : is_ply ? read_ply(bytes) : read_stl(bytes);
  // As isomesh says it in the header of an STL and in a comment of a PLY; ", RAS" in older PLY
  // files.
  const std::string_view head = bytes.substr(0, is_ply ? bytes.find("end_header") : 80);
  const auto tells = [&](std::string_view words) { return head.find(words) != head.npos; };
  const bool is_ras = !is_glb && (tells("SPACE=RAS") || (is_ply && tells(", RAS\n")));
  constexpr double kMost = 1e30;  // products of squares stay finite
  for (Vec& point : surface.points) {
    if (is_ras) point = {-point[0], -point[1], point[2]};
    if (!std::ranges::all_of(point, [](double x) { return std::abs(x) <= kMost; })) {
      refuse("a coordinate is no number, or not finite");
    }
  }
  join_equal_points(surface);
  return surface;
} catch (const Error& error) {
  refuse_glb(error);
}

}  // namespace isomesh::verify
