#include "server/mesh/smooth.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLayersPerSlab = 4;
constexpr std::size_t kVerticesPerChunk = 16384;

// The vertices of a run of layers, and the triangles that can name them: those of the same layers
// and of the one below.
struct VertexSlab {
  VertexSlab(const Mesh& mesh, std::size_t slab)
      : VertexSlab(mesh, slab * kLayersPerSlab,
                   std::min(mesh.layers(), (slab + 1) * kLayersPerSlab)) {}

  VertexSlab(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer)
      : begin(mesh.layer_vertices[first_layer]),
        end(mesh.layer_vertices[end_layer]),
        triangles(mesh.triangles.span().subspan(
            mesh.layer_triangles[first_layer == 0 ? 0 : first_layer - 1],
            mesh.layer_triangles[end_layer] -
                mesh.layer_triangles[first_layer == 0 ? 0 : first_layer - 1])) {}

  bool contains(std::uint32_t vertex) const { return vertex >= begin && vertex < end; }
  std::size_t size() const { return end - begin; }

  std::uint64_t begin;
  std::uint64_t end;
  std::span<const Triangle> triangles;
};

// Calls visit(vertex, next, previous) for the corners of the slab's vertices.
template <class Visit>
void for_each_corner(const VertexSlab& slab, Visit visit) {
  for (const auto& [a, b, c] : slab.triangles) {
    if (slab.contains(a)) visit(a, b, c);
    if (slab.contains(b)) visit(b, c, a);
    if (slab.contains(c)) visit(c, a, b);
  }
}

// Writes the number of neighbours of the slab's vertices to offsets[v + 1]; returns their sum. In
// an oriented manifold the triangles around a vertex name each of its neighbours once as the next
// corner and once as the previous one, unless the vertex lies on the boundary: then its first
// neighbour is never a next one and its last never a previous one, and the sums differ.
std::uint64_t count_neighbors(const Mesh& mesh, const VertexSlab& slab,
                              Connectivity& connectivity) {
  std::vector<std::uint32_t> balance(slab.size(), 0);
  std::uint32_t* counts = connectivity.offsets.data() + 1;
  std::fill(counts + slab.begin, counts + slab.end, 0);
  for_each_corner(slab, [&](std::uint32_t vertex, std::uint32_t next, std::uint32_t previous) {
    ++counts[vertex];
    balance[vertex - slab.begin] += next - previous;
  });
  std::uint64_t sum = 0;
  for (std::size_t v = slab.begin; v < slab.end; ++v) {
    if (balance[v - slab.begin] != 0 || mesh.is_on_border(v)) counts[v] = 0;
    sum += counts[v];
  }
  return sum;
}

void fill_neighbors(const VertexSlab& slab, Connectivity& connectivity) {
  const std::uint32_t* offsets = connectivity.offsets.data();
  std::vector<std::uint32_t> cursor(offsets + slab.begin, offsets + slab.end);
  for_each_corner(slab, [&](std::uint32_t vertex, std::uint32_t next, std::uint32_t /*previous*/) {
    const bool on_boundary = offsets[vertex] == offsets[vertex + 1];
    if (!on_boundary) connectivity.neighbors[cursor[vertex - slab.begin]++] = next;
  });
}

// A position and one idle lane. Loading it reads four bytes past the position: the next one's, or
// what Buffer keeps behind the last.
using Float4 = float __attribute__((vector_size(16)));

Float4 load(const Vec3& position) {
  Float4 lanes;
  std::memcpy(&lanes, &position, sizeof lanes);
  return lanes;
}

void smooth_chunk(const Connectivity& connectivity, float lambda, std::size_t begin,
                  std::size_t end, const Vec3* from, Vec3* to) {
  const std::uint32_t* offsets = connectivity.offsets.data();
  const std::uint32_t* neighbors = connectivity.neighbors.data();
  for (std::size_t v = begin; v < end; ++v) {
    const std::uint32_t first = offsets[v];
    const std::uint32_t last = offsets[v + 1];
    Float4 position = load(from[v]);
    if (first != last) {
      Float4 sum = {};
      for (std::uint32_t n = first; n < last; ++n) sum += load(from[neighbors[n]]);
      const Float4 mean = sum * (1 / static_cast<float>(last - first));
      position = lambda == 1 ? mean : position + (mean - position) * lambda;
    }
    std::memcpy(&to[v], &position, sizeof to[v]);
  }
}

}  // namespace

void build_connectivity(const Mesh& mesh, const Context& context, Connectivity& connectivity) {
  const std::size_t slabs = (mesh.layers() + kLayersPerSlab - 1) / kLayersPerSlab;
  connectivity.offsets.resize_for_overwrite(mesh.positions.size() + 1);
  std::vector<std::uint64_t> slab_offsets(slabs + 1, 0);
  const Context quiet{context.stop, nullptr};
  parallel_for(quiet, slabs, [&](std::size_t slab) {
    slab_offsets[slab + 1] = count_neighbors(mesh, VertexSlab(mesh, slab), connectivity);
  });
  std::partial_sum(slab_offsets.begin(), slab_offsets.end(), slab_offsets.begin());
  if (slab_offsets.back() > UINT32_MAX) {
    throw Error(ErrorCode::kTooLarge, "the surface has more edges than 32 bits can index");
  }

  connectivity.neighbors.resize_for_overwrite(slab_offsets.back());
  connectivity.offsets[0] = 0;
  parallel_for(quiet, slabs, [&](std::size_t task) {
    const VertexSlab slab(mesh, task);
    auto running = static_cast<std::uint32_t>(slab_offsets[task]);
    for (std::size_t v = slab.begin; v < slab.end; ++v) {
      running += connectivity.offsets[v + 1];
      connectivity.offsets[v + 1] = running;
    }
  });
  parallel_for(context, slabs,
               [&](std::size_t slab) { fill_neighbors(VertexSlab(mesh, slab), connectivity); });
}

void smooth_laplacian(const Connectivity& connectivity, const SmoothOptions& options,
                      const Context& context, Mesh& mesh, Buffer<Vec3>& scratch) {
  const std::size_t vertices = mesh.positions.size();
  const std::size_t chunks = (vertices + kVerticesPerChunk - 1) / kVerticesPerChunk;
  const auto lambda = static_cast<float>(options.lambda);
  if (options.passes > 0) scratch.resize_for_overwrite(vertices);
  for (int pass = 0; pass < options.passes; ++pass) {
    Context of_pass{context.stop, nullptr};
    if (context.progress) {
      of_pass.progress = [&](double done) { context.progress((pass + done) / options.passes); };
    }
    parallel_for(of_pass, chunks, [&](std::size_t chunk) {
      const std::size_t begin = chunk * kVerticesPerChunk;
      const std::size_t end = std::min(vertices, begin + kVerticesPerChunk);
      smooth_chunk(connectivity, lambda, begin, end, mesh.positions.data(), scratch.data());
    });
    std::swap(mesh.positions, scratch);
  }
}

}  // namespace isomesh::mesh
