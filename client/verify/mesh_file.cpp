#include "client/verify/mesh_file.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "proto/json_tree.h"

namespace isomesh::verify {
namespace {

using namespace json_values;
using Indices = std::array<std::uint32_t, 3>;

static_assert(std::endian::native == std::endian::little, "the files are little-endian");

constexpr std::size_t kPoint = 3 * sizeof(float);

[[noreturn]] void refuse(const std::string& reason) {
  throw Error(ErrorCode::kInvalidParameter, "the mesh cannot be read: " + reason);
}

template <class T>
T at(std::string_view bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

Vec point_at(std::string_view bytes, std::size_t offset) {
  const auto p = at<std::array<float, 3>>(bytes, offset);
  return {p[0], p[1], p[2]};
}

void add_corners(Surface& surface, const Corners& corners) {
  const auto first = static_cast<std::uint32_t>(surface.points.size());
  surface.points.insert(surface.points.end(), corners.begin(), corners.end());
  surface.triangles.push_back({first, first + 1, first + 2});
}

double coordinate(std::string_view word) {
  const auto x = parse_double(word);
  return x ? *x : throw Error(ErrorCode::kInvalidParameter, "a coordinate of the STL is no number");
}

Surface read_text_stl(std::string_view bytes) {
  const auto all = words(bytes.substr(std::min(bytes.find('\n'), bytes.size())));
  constexpr std::size_t kFacet = 21;  // words
  Surface surface;
  std::size_t n = 0;
  for (; n + kFacet < all.size() && all[n] == "facet"; n += kFacet) {
    Corners corners;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t vertex = n + 7 + 4 * c;
      if (all[vertex] != "vertex") refuse("a facet of the STL lacks a vertex");
      for (std::size_t x = 0; x < 3; ++x) corners[c][x] = coordinate(all[vertex + 1 + x]);
    }
    add_corners(surface, corners);
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
  if (size != bytes.size() && bytes.starts_with("solid")) return read_text_stl(bytes);
  if (size != bytes.size()) {
    refuse("it has " + std::to_string(bytes.size()) + " bytes, but an STL file of " +
           std::to_string(count) + " triangles has " + std::to_string(size));
  }
  Surface surface;
  for (std::size_t facet = kHeader; facet < size; facet += kFacet) {
    add_corners(surface, {point_at(bytes, facet + kPoint), point_at(bytes, facet + 2 * kPoint),
                          point_at(bytes, facet + 3 * kPoint)});
  }
  return surface;
}

Surface read_ply(std::string_view bytes) {
  constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = bytes.find(kEnd);
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
  for (std::size_t n = 0; n < faces; n += kPoint) surface.points.push_back(point_at(body, n));
  for (std::size_t n = faces; n < body.size(); n += kFace) {
    if (body[n] != 3) refuse("a face of the PLY is no triangle");
    surface.triangles.push_back(at<Indices>(body, n + 1));
  }
  return surface;
}

// A GLB of one surface, as isomesh writes it without a codec.
class Glb {
 public:
  explicit Glb(std::string_view bytes) {
    constexpr std::size_t kHeader = 12;
    if (bytes.size() < kHeader || at<std::uint32_t>(bytes, 8) != bytes.size()) {
      refuse("the GLB is truncated");
    }
    bytes.remove_prefix(kHeader);
    gltf_ = JsonTree(take_chunk(bytes, "JSON"));
    if (!bytes.empty()) binary_ = take_chunk(bytes, std::string_view("BIN\0", 4));
  }

  Surface read() const {
    if (find(gltf_.root(), "extensionsRequired")) refuse("the GLB has a codec; ask for none");
    Surface surface;
    const Json& nodes = existing(listed("scenes", 0), "nodes");
    if (array_size(nodes) == 0) return surface;
    if (array_size(nodes) > 1) refuse("the GLB has several objects");
    const Json& node = listed("nodes", count_in(element(nodes, 0)));
    // Metres with Y up, from millimetres in LPS: (x, y, z) becomes (x, z, -y) / 1000.
    expect(node, "rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)});
    expect(node, "scale", {0.001, 0.001, 0.001});
    expect(node, "translation", {});
    expect(node, "matrix", {});
    const Json& mesh = listed("meshes", count_in(existing(node, "mesh")));
    const Json& primitive = element_of(existing(mesh, "primitives"), 0);
    const Json& position = existing(existing(primitive, "attributes"), "POSITION");
    const std::string_view points = items(position, 5126, "VEC3", kPoint);
    const std::string_view corners = items(existing(primitive, "indices"), 5125, "SCALAR", 4);
    for (std::size_t n = 0; n < points.size(); n += kPoint) {
      surface.points.push_back(point_at(points, n));
    }
    for (std::size_t n = 0; n + sizeof(Indices) <= corners.size(); n += sizeof(Indices)) {
      surface.triangles.push_back(at<Indices>(corners, n));
    }
    return surface;
  }

 private:
  // The content of the first chunk, which is removed.
  static std::string_view take_chunk(std::string_view& bytes, std::string_view type) {
    constexpr std::size_t kHeader = 8;
    if (bytes.size() < kHeader || bytes.substr(4, 4) != type ||
        bytes.size() - kHeader < at<std::uint32_t>(bytes, 0)) {
      refuse("the GLB lacks a chunk, or a chunk is truncated");
    }
    const std::string_view chunk = bytes.substr(kHeader, at<std::uint32_t>(bytes, 0));
    bytes.remove_prefix(kHeader + chunk.size());
    return chunk;
  }

  static std::uint64_t count_in(const Json& json) { return whole(json, UINT32_MAX); }
  static const Json& element_of(const Json& array, std::uint64_t index) {
    if (index >= array_size(array)) refuse("the GLB names an object that it lacks");
    return element(array, index);
  }
  const Json& listed(const char* list, std::uint64_t index) const {
    return element_of(existing(gltf_.root(), list), index);
  }

  static void expect(const Json& node, const char* name, const std::vector<double>& expected) {
    std::vector<double> found;
    const Json* numbers = find(node, name);
    for (std::size_t n = 0; numbers && n < array_size(*numbers); ++n) {
      found.push_back(number(element(*numbers, n)));
    }
    const auto is_near = [](double a, double b) { return std::abs(a - b) < 1e-9; };
    if (!std::ranges::equal(found, expected, is_near)) refuse("the GLB is not placed by isomesh");
  }

  // The bytes of an accessor of that type.
  std::string_view items(const Json& index, unsigned type, std::string_view shape,
                         std::size_t item_bytes) const {
    const Json& accessor = listed("accessors", count_in(index));
    const Json& view = listed("bufferViews", count_in(existing(accessor, "bufferView")));
    const auto optional = [](const Json& json, const char* name, std::uint64_t standard) {
      const Json* found = find(json, name);
      return found ? count_in(*found) : standard;
    };
    const auto begin = optional(view, "byteOffset", 0) + optional(accessor, "byteOffset", 0);
    const std::uint64_t bytes = item_bytes * count_in(existing(accessor, "count"));
    if (count_in(existing(accessor, "componentType")) != type || find(accessor, "sparse") ||
        text(existing(accessor, "type")) != shape || begin + bytes > binary_.size() ||
        optional(view, "byteStride", item_bytes) != item_bytes) {
      refuse("the GLB lacks bytes, or has other things than floats and 32-bit indices");
    }
    return binary_.substr(begin, bytes);
  }

  JsonTree gltf_;
  std::string_view binary_;
};

Surface read_glb(std::string_view bytes) try {
  return Glb(bytes).read();
} catch (const Error& error) {
  if (error.code() == ErrorCode::kInvalidParameter) throw;
  refuse(std::string("the GLB ") + error.what());
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

}  // namespace

Surface read_surface(std::string_view bytes) {
  const bool is_glb = bytes.starts_with("glTF");
  const bool is_ply = bytes.starts_with("ply\n");
  Surface surface = is_glb ? read_glb(bytes) : is_ply ? read_ply(bytes) : read_stl(bytes);
  // As isomesh says it in the header of an STL and in a comment of a PLY.
  const std::string_view head = bytes.substr(0, is_ply ? bytes.find("end_header") : 80);
  const bool is_ras = !is_glb && head.find(is_ply ? ", RAS\n" : "SPACE=RAS") != head.npos;
  constexpr double kMost = 1e30;  // products of squares stay finite
  for (Vec& point : surface.points) {
    if (is_ras) point = {-point[0], -point[1], point[2]};
    if (!std::ranges::all_of(point, [](double x) { return std::abs(x) <= kMost; })) {
      refuse("a coordinate is not finite, or is too large");
    }
  }
  join_equal_points(surface);
  return surface;
}

}  // namespace isomesh::verify
