#include "server/codec/draco_chunk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "proto/error.h"
#include "server/codec/encode.h"
#include "server/codec/libdraco.h"

namespace isomesh::codec {
namespace {

// The speeds at which Draco itself uses standard edgebreaker. Slower speeds use valence coding,
// which is smaller and slower than our encoder.
constexpr int kSlowestOurs = 5;
constexpr int kFastestOurs = 9;

template <class Visit>
void for_each_triangle(const mesh::Mesh& mesh, const Run& run, Visit visit) {
  for (std::size_t t = run.begin; t < run.end; ++t) visit(mesh.triangles[t]);
}

void set_bounds(std::span<const mesh::Vec3> positions, const Grid& grid, DracoStream& stream) {
  if (positions.empty()) return;
  const Bounds bounds = bounds_of(positions);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    stream.bounds.low[axis] = grid.decoded(bounds.low[axis], axis);
    stream.bounds.high[axis] = grid.decoded(bounds.high[axis], axis);
  }
}

}  // namespace

bool is_own_draco(const DracoParameters& draco) {
  return draco.speed >= kSlowestOurs && draco.speed <= kFastestOurs &&
         draco.position_bits <= edgebreaker::Encoder::kMostPositionBits;
}

void OwnVertices::begin(std::uint32_t low, std::uint32_t high) {
  lowest = low;
  number.assign(std::size_t{high} - low + 1, kUnnamed);
  origin.clear();
  positions.clear();
  normals.clear();
  distances.clear();
  triangles.clear();
}

std::optional<mesh::Topology> topology_of(const mesh::Mesh& mesh, std::span<DracoStream> streams,
                                          const mesh::Context& context) {
  std::vector<mesh::PartTopology> parts;
  for (DracoStream& stream : streams) {
    if (!stream.topology) return std::nullopt;
    parts.push_back(*std::move(stream.topology));
  }
  return join_topology(mesh, parts, context);
}

BlockCut::BlockCut(std::uint64_t triangles, std::size_t layers, std::size_t triangles_per_block) {
  if (triangles == 0) return;
  const double of_layer = static_cast<double>(triangles) / static_cast<double>(layers);
  const auto target = static_cast<double>(triangles_per_block);
  const auto at_least_one = [](double number) {
    return static_cast<std::size_t>(std::max(1.0, number));
  };
  const auto layers_for = [&] {
    return at_least_one(std::round(target * static_cast<double>(parts) / of_layer));
  };
  // Assumes that the volume is as deep as it is high: then a block of n layers by a layer's nth
  // part is a cube.
  parts = at_least_one(std::round(std::sqrt(static_cast<double>(triangles) / target)));
  depth = layers_for();
  if (depth <= kMostLayers) return;
  parts = at_least_one(std::floor(of_layer * kMostLayers / target));
  depth = layers_for();
  if (parts > 1) depth = std::min(depth, kMostLayers);
}

std::vector<Block> blocks_of(const mesh::Mesh& mesh, std::size_t begin, std::size_t end,
                             const BlockCut& cut) {
  std::vector<Block> blocks;
  for (std::size_t part = 0; part < cut.parts; ++part) {
    Block block;
    for (std::size_t layer = begin; layer < end; ++layer) {
      const std::uint64_t first = mesh.layer_triangles[layer];
      const std::uint64_t count = mesh.layer_triangles[layer + 1] - first;
      const Run run = {first + count * part / cut.parts, first + count * (part + 1) / cut.parts};
      if (run.begin < run.end) block.push_back(run);
    }
    if (!block.empty()) blocks.push_back(std::move(block));
  }
  return blocks;
}

std::vector<Block> cut_blocks(const mesh::Mesh& mesh, std::size_t triangles_per_block) {
  const BlockCut cut(mesh.triangles.size(), mesh.layers(), triangles_per_block);
  std::vector<Block> blocks;
  for (std::size_t bottom = 0; bottom < mesh.layers(); bottom += cut.depth) {
    const std::size_t top = std::min(mesh.layers(), bottom + cut.depth);
    for (Block& block : blocks_of(mesh, bottom, top, cut)) blocks.push_back(std::move(block));
  }
  return blocks;
}

DracoStream DracoEncoder::encode_block(const mesh::Mesh& mesh, const Block& block,
                                       const DracoOptions& options, const VertexData& data,
                                       const mesh::Context& context) {
  take(mesh, block, data);
  DracoStream stream = encode({part_.positions, part_.data(data.most_distance), part_.triangles,
                               layer_vertices_, layer_triangles_},
                              options, edgebreaker::Threads::kOne, context);
  set_bounds(part_.positions, options.grid, stream);
  if (stream.topology) stream.topology = in_mesh(*std::move(stream.topology));
  return stream;
}

DracoStream DracoEncoder::encode_whole(const mesh::Mesh& mesh, const DracoOptions& options,
                                       const VertexData& data, const mesh::Context& context) {
  const Part part = {mesh.positions.span(), data, mesh.triangles.span(), mesh.layer_vertices,
                     mesh.layer_triangles};
  DracoStream stream = encode(part, options, edgebreaker::Threads::kAll, context);
  set_bounds(part.positions, options.grid, stream);
  return stream;
}

// The only place that chooses the encoder.
DracoStream DracoEncoder::encode(const Part& part, const DracoOptions& options,
                                 edgebreaker::Threads threads, const mesh::Context& context) {
  most_triangles_ = std::max(most_triangles_, part.triangles.size());
  if (is_own_draco({options.grid.bits, options.speed}) && part.data.distances.empty()) {
    auto encoded = encoder_.encode({part.positions, part.triangles, part.layer_vertices,
                                    part.layer_triangles, part.data.normals},
                                   options.grid, threads, context);
    if (encoded) {
      return {.bytes = std::move(encoded->bytes),
              .vertices = encoded->vertices,
              .triangles = static_cast<std::uint32_t>(part.triangles.size()),
              .position_id = edgebreaker::kPositionId,
              .normal_id = edgebreaker::kNormalId,
              .topology = std::move(encoded->topology)};
    }
  }
  return encode_with_libdraco({part.positions, part.data, part.triangles}, options.grid,
                              options.speed);
}

// The topology of the last block, in the mesh's vertex numbers.
mesh::PartTopology DracoEncoder::in_mesh(mesh::PartTopology part) const {
  const std::vector<std::uint32_t>& origin = part_.origin;
  part.first_word = part_.lowest / 64;
  std::vector<std::uint64_t> inner((part_.lowest + part_.number.size() - 1) / 64 + 1 -
                                   part.first_word);
  for (std::size_t v = 0; v < origin.size(); ++v) {
    const std::uint64_t bit = part.inner[v / 64] >> (v % 64) & 1;
    inner[origin[v] / 64 - part.first_word] |= bit << (origin[v] % 64);
  }
  part.inner = std::move(inner);
  for (auto& [vertex, next, previous] : part.rim) {
    vertex = origin[vertex];
    next = origin[next];
    previous = origin[previous];
  }
  for (auto& [vertex, component] : part.rim_components) vertex = origin[vertex];
  return part;
}

// Renumbers the block's vertices in the order of their first use by its triangles. Vertices that a
// run uses first form the layer above it: only the next run may use them too.
void DracoEncoder::take(const mesh::Mesh& mesh, const Block& block, const VertexData& data) {
  std::uint32_t low = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t high = 0;
  for (const Run& run : block) {
    for_each_triangle(mesh, run, [&](const mesh::Triangle& triangle) {
      low = std::min({low, triangle[0], triangle[1], triangle[2]});
      high = std::max({high, triangle[0], triangle[1], triangle[2]});
    });
  }
  // Triangles of neighbouring layers use vertices of neighbouring layers, so the range is short.
  part_.begin(low, high);
  layer_vertices_.assign(2, 0);
  layer_triangles_.assign(1, 0);
  for (const Run& run : block) {
    for_each_triangle(mesh, run, [&](const mesh::Triangle& triangle) {
      part_.add(triangle, mesh.positions.span(), data);
    });
    layer_vertices_.push_back(part_.positions.size());
    layer_triangles_.push_back(part_.triangles.size());
  }
  layer_triangles_.push_back(part_.triangles.size());
}

Encoders& Encoders::instance() {
  static Encoders encoders;
  return encoders;
}

std::unique_ptr<DracoEncoder> Encoders::take(std::size_t triangles) {
  const Lock lock(mutex_);
  if (idle_.empty()) return std::make_unique<DracoEncoder>();
  // The smallest that is large enough, otherwise the largest.
  const auto best = std::ranges::min_element(idle_, {}, [&](const auto& encoder) {
    const std::size_t has = encoder->most_triangles();
    return has >= triangles ? std::pair(0, has) : std::pair(1, triangles - has);
  });
  auto encoder = std::move(*best);
  idle_.erase(best);
  idle_triangles_ -= encoder->most_triangles();
  return encoder;
}

void Encoders::give_back(std::unique_ptr<DracoEncoder> encoder) {
  const Lock lock(mutex_);
  if (idle_triangles_ + encoder->most_triangles() > kMostIdleTriangles) return;
  idle_triangles_ += encoder->most_triangles();
  idle_.push_back(std::move(encoder));
}

}  // namespace isomesh::codec
