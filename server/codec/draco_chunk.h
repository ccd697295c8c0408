// Blocks of triangles as Draco streams on one shared quantisation grid, and who encodes them;
// private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/codec/draco/encoder.h"
#include "server/codec/draco/grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology_parts.h"

namespace isomesh::codec {

struct DracoStream {
  std::vector<std::byte> bytes;
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint32_t position_id = 0;  // the attributes' ids within the stream
  std::uint32_t normal_id = 0;
  std::uint32_t distance_id = 0;
  mesh::Vec3 low = {0, 0, 0};  // bounds of the decoded positions
  mesh::Vec3 high = {0, 0, 0};
  // What encoding it has shown of the triangles, in the mesh's numbers of vertices; libdraco shows
  // nothing.
  std::optional<mesh::PartTopology> topology;
};

// The topology of a mesh whose triangles these streams have between them; none where one of them
// has shown nothing, or it does not follow.
std::optional<mesh::Topology> topology_of(const mesh::Mesh& mesh, std::span<DracoStream> streams,
                                          const mesh::Context& context);

// Consecutive triangles [begin, end).
struct Run {
  std::size_t begin = 0;
  std::size_t end = 0;
};

// Triangles that are encoded together: a run from each of some consecutive layers.
using Block = std::vector<Run>;

// Cuts the mesh into blocks of about that many triangles which are as compact as the order of the
// triangles allows, because blocks share the vertices on their seams: a layer is cut into equal
// runs, and runs of the same place in consecutive layers lie above each other. Every triangle is in
// one block. No empty blocks.
std::vector<Block> cut_blocks(const mesh::Mesh& mesh, std::size_t triangles_per_block);

// What vertices have beside their positions; of each as many as positions, or none.
struct VertexData {
  std::span<const mesh::Vec3> normals = {};
  std::span<const float> distances = {};  // millimetres
  float most_distance = 0;                // of all that share a grid; finite

  bool empty() const { return normals.empty() && distances.empty(); }
};

struct DracoOptions {
  Grid grid;
  int speed = 7;
};

// Encodes blocks of a mesh, or all of it, one after the other in memory that it keeps. Our own
// encoder takes what it covers at the speeds 5 to 9: see draco/encoder.h. libdraco takes the rest:
// the slower speeds, whose streams are smaller, speed 10, which is sequential, distances, finer
// grids, and surfaces that are no oriented manifolds. Not thread safe. Throws
// Error kInternal when libdraco refuses, and kCancelled, which libdraco does not look at.
class DracoEncoder {
 public:
  // The block's triangles with the vertices they name, on one thread. `data` is of the mesh's
  // vertices; it decodes to the same bits in every stream.
  DracoStream encode_block(const mesh::Mesh& mesh, const Block& block, const DracoOptions& options,
                           const VertexData& data, const mesh::Context& context);

  // All triangles with the vertices they name, which are all vertices. Our own encoder takes
  // several threads, and gives the same bytes on any number.
  DracoStream encode_whole(const mesh::Mesh& mesh, const DracoOptions& options,
                           const VertexData& data, const mesh::Context& context);

  // Of those that it has encoded at once: its memory follows from it.
  std::size_t most_triangles() const { return most_triangles_; }

 private:
  // What is encoded, as arrays; layers as mesh::Mesh has them.
  struct Part {
    std::span<const mesh::Vec3> positions;
    VertexData data;
    std::span<const mesh::Triangle> triangles;
    std::span<const std::uint64_t> layer_vertices;
    std::span<const std::uint64_t> layer_triangles;
  };
  // A block, with vertices of its own.
  struct PartMemory {
    std::vector<mesh::Vec3> positions;
    std::vector<mesh::Vec3> normals;
    std::vector<float> distances;
    std::vector<mesh::Triangle> triangles;
    std::vector<std::uint64_t> layer_vertices;
    std::vector<std::uint64_t> layer_triangles;
    std::uint32_t lowest = 0;           // of the mesh's vertices
    std::vector<std::uint32_t> number;  // of the mesh's vertices from the lowest on
    std::vector<std::uint32_t> origin;  // of the block's vertices, in the mesh
  };

  mesh::PartTopology in_mesh(mesh::PartTopology part) const;
  void take(const mesh::Mesh& mesh, const Block& block, const VertexData& data);
  DracoStream encode(const Part& part, const DracoOptions& options, edgebreaker::Threads threads,
                     const mesh::Context& context);

  PartMemory part_;
  std::size_t most_triangles_ = 0;
  edgebreaker::Encoder encoder_;
};

}  // namespace isomesh::codec
