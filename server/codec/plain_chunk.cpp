#include "server/codec/plain_chunk.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "server/mesh/measure/normals.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kPieceBytes = std::size_t{128} << 10;

template <class Element>
void add_array(GlbArray::Kind kind, std::size_t count, ArrayChunk& chunk) {
  static_assert(sizeof(Element) % kGlbAlignment == 0);
  chunk.arrays.push_back({.kind = kind,
                          .begin = chunk.size(),
                          .bytes = count * sizeof(Element),
                          .stride = sizeof(Element),
                          .count = count});
}

class Writer {
 public:
  Writer(const mesh::Context& context, const Sink& sink) : context_(context), sink_(sink) {}

  template <class Element>
  void put(std::span<const Element> elements) const {
    for (auto rest = std::as_bytes(elements); !rest.empty();) {
      context_.throw_if_stopped();
      const std::size_t bytes = std::min(rest.size(), kPieceBytes);
      sink_(rest.first(bytes));
      rest = rest.subspan(bytes);
    }
  }

 private:
  const mesh::Context& context_;
  const Sink& sink_;
};

}  // namespace

ArrayChunk describe_plain(std::size_t vertices, std::size_t triangles,
                          const MeshParameters& parameters) {
  ArrayChunk chunk;
  chunk.vertices = static_cast<std::uint32_t>(vertices);
  chunk.triangles = static_cast<std::uint32_t>(triangles);
  add_array<mesh::Vec3>(GlbArray::Kind::kPositions, vertices, chunk);
  if (parameters.normals) add_array<mesh::Vec3>(GlbArray::Kind::kNormals, vertices, chunk);
  if (parameters.distances) add_array<float>(GlbArray::Kind::kDistances, vertices, chunk);
  add_array<std::uint32_t>(GlbArray::Kind::kIndices, 3 * triangles, chunk);
  return chunk;
}

void put_plain(const mesh::Mesh& mesh, const MeshParameters& parameters, const VertexData& data,
               const mesh::Context& context, const Sink& sink) {
  const Writer writer(context, sink);
  writer.put(mesh.positions.span());
  if (parameters.normals) {
    mesh::Buffer<mesh::Vec3> normals;
    if (data.normals.empty()) vertex_normals(mesh, {context.stop, nullptr}, normals);
    writer.put(data.normals.empty() ? std::as_const(normals).span() : data.normals);
  }
  writer.put(data.distances);
  writer.put(mesh.triangles.span());
}

}  // namespace isomesh::codec
