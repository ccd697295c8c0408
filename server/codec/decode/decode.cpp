#include "server/codec/decode/decode.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "proto/error.h"
#include "server/codec/decode/decoders.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace decoding {
namespace {

constexpr std::size_t kElementsPerTask = std::size_t{1} << 16;

template <class T, class Holds>
bool all_of(const mesh::Buffer<T>& elements, const mesh::Context& context, const Holds& holds) {
  std::atomic<bool> all = true;
  const auto look = [&](std::size_t begin, std::size_t end) {
    if (!std::ranges::all_of(elements.span().subspan(begin, end - begin), holds)) all = false;
  };
  mesh::for_chunks({context.stop, nullptr}, elements.size(), look, kElementsPerTask);
  return all;
}

}  // namespace

void check(const DecodedSurface& surface, MeshFormat format, const mesh::Context& context) {
  const std::size_t vertices = surface.positions.size();
  const bool is_finite = all_of(surface.positions, context, [](const mesh::Vec3& position) {
    return std::isfinite(position[0]) && std::isfinite(position[1]) && std::isfinite(position[2]);
  });
  if (!is_finite) refuse(format, "a position is not a finite number");
  const bool is_there = all_of(surface.triangles, context, [&](const mesh::Triangle& triangle) {
    return triangle[0] < vertices && triangle[1] < vertices && triangle[2] < vertices;
  });
  if (!is_there) refuse(format, "a triangle names a vertex that does not exist");
}

void refuse(MeshFormat format, const std::string& why) {
  throw Error(ErrorCode::kInternal, "the " + std::string(to_string(format)) +
                                        " file that was written cannot be read: " + why);
}

}  // namespace decoding

DecodedSurface join(std::vector<DecodedSurface>&& parts, const mesh::Context& context) {
  if (parts.size() == 1) return std::move(parts.front());
  std::vector<std::size_t> vertices = {0};
  std::vector<std::size_t> triangles = {0};
  for (const DecodedSurface& part : parts) {
    vertices.push_back(vertices.back() + part.positions.size());
    triangles.push_back(triangles.back() + part.triangles.size());
  }
  if (vertices.back() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "The file has " + std::to_string(vertices.back()) +
                                          " vertices, more than 32 bits can number.");
  }
  DecodedSurface all;
  all.positions.resize_for_overwrite(vertices.back());
  all.triangles.resize_for_overwrite(triangles.back());
  mesh::parallel_for({context.stop, nullptr}, parts.size(), [&](std::size_t n) {
    const DecodedSurface part = std::move(parts[n]);
    std::ranges::copy(part.positions, all.positions.begin() + vertices[n]);
    const auto first = static_cast<std::uint32_t>(vertices[n]);
    std::ranges::transform(
        part.triangles, all.triangles.begin() + triangles[n], [&](const mesh::Triangle& triangle) {
          return mesh::Triangle{triangle[0] + first, triangle[1] + first, triangle[2] + first};
        });
  });
  return all;
}

}  // namespace isomesh::codec
