// Encodes blocks of triangles as Draco streams on one shared quantisation grid, and chooses their
// encoder. Private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/mutex.h"
#include "server/codec/bounds.h"
#include "server/codec/draco/encoder.h"
#include "server/codec/draco/grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology_parts.h"

namespace isomesh::codec {

struct DracoStream {
  std::vector<std::byte> bytes;
  std::size_t aside = 0;  // the bytes if they have been set aside
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint32_t position_id = 0;  // the attributes' ids within the stream
  std::uint32_t normal_id = 0;
  std::uint32_t distance_id = 0;
  Bounds bounds = {};  // of the decoded positions
  // The topology of the triangles, found during encoding, in the mesh's vertex numbers. libdraco
  // reports none.
  std::optional<mesh::PartTopology> topology;

  std::size_t size() const { return bytes.size() + aside; }
};

// Combines the topology of streams that cover all triangles of the mesh. Empty if a stream has
// none, or if the parts do not determine it.
std::optional<mesh::Topology> topology_of(const mesh::Mesh& mesh, std::span<DracoStream> streams,
                                          const mesh::Context& context);

// Consecutive triangles [begin, end).
struct Run {
  std::size_t begin = 0;
  std::size_t end = 0;
};

// Triangles that are encoded together: one run from each of several consecutive layers.
using Block = std::vector<Run>;

// How a surface is cut into blocks of about equally many triangles. Blocks are as compact as the
// order of the triangles allows, because they duplicate the vertices on their seams: a layer is cut
// into equal runs, and a block stacks the runs at one place of consecutive layers.
struct BlockCut {
  std::size_t parts = 1;  // of a layer
  std::size_t depth = 1;  // layers of a block; at most kMostLayers if a layer has several parts

  static constexpr std::size_t kMostLayers = 32;

  // For blocks of about so many triangles.
  BlockCut(std::uint64_t triangles, std::size_t layers, std::size_t triangles_per_block);
};

// The blocks of the layers [begin, end), which are those of a row of blocks. No block is empty.
std::vector<Block> blocks_of(const mesh::Mesh& mesh, std::size_t begin, std::size_t end,
                             const BlockCut& cut);
// Every triangle is in one block.
std::vector<Block> cut_blocks(const mesh::Mesh& mesh, std::size_t triangles_per_block);

// The name of distances in files. glTF requires the underscore for application-specific attributes.
inline constexpr const char* kDistanceAttribute = "_DISTANCE_MM";

// Vertex attributes beside the positions; each has one element per position or none.
struct VertexData {
  std::span<const mesh::Vec3> normals = {};
  std::span<const float> distances = {};  // millimetres
  float most_distance = 0;                // the maximum over all that share a grid; finite

  bool empty() const { return normals.empty() && distances.empty(); }
};

// Triangles with only the vertices that they use, in the order of their first use.
struct OwnVertices {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Vec3> normals;
  std::vector<float> distances;
  std::vector<mesh::Triangle> triangles;
  std::uint32_t lowest = 0;           // lowest original vertex
  std::vector<std::uint32_t> number;  // own vertex of each original one from `lowest` on
  std::vector<std::uint32_t> origin;  // original vertex of each own one

  // For triangles with the original vertices [low, high]. The memory is reused.
  void begin(std::uint32_t low, std::uint32_t high);
  void add(const mesh::Triangle& triangle, std::span<const mesh::Vec3> all,
           const VertexData& data) {
    mesh::Triangle& renumbered = triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t original = triangle[corner];
      std::uint32_t& vertex = number[original - lowest];
      if (vertex == kUnnamed) {
        vertex = static_cast<std::uint32_t>(positions.size());
        origin.push_back(original);
        positions.push_back(all[original]);
        if (!data.normals.empty()) normals.push_back(data.normals[original]);
        if (!data.distances.empty()) distances.push_back(data.distances[original]);
      }
      renumbered[corner] = vertex;
    }
  }
  VertexData data(float most_distance) const { return {normals, distances, most_distance}; }

 private:
  static constexpr std::uint32_t kUnnamed = ~std::uint32_t{0};
};

struct DracoOptions {
  Grid grid;
  int speed = 7;
};

// Encodes blocks of a mesh, or all of it, in memory that it keeps. Our own encoder takes the
// surfaces that it supports at the speeds 5 to 9; see draco/encoder.h. libdraco takes the rest:
// slower speeds, whose streams are smaller; speed 10, which is sequential; distances; finer grids;
// and surfaces that are not oriented manifolds. Not thread safe. Throws Error kInternal if libdraco
// fails, and kCancelled, which libdraco does not check.
class DracoEncoder {
 public:
  // Encodes the block's triangles and their vertices on one thread. `data` is indexed by the mesh's
  // vertices; it decodes to the same bits in every stream.
  DracoStream encode_block(const mesh::Mesh& mesh, const Block& block, const DracoOptions& options,
                           const VertexData& data, const mesh::Context& context);

  // Encodes all triangles; every vertex is in one. Our own encoder uses several threads; the bytes
  // do not depend on their number.
  DracoStream encode_whole(const mesh::Mesh& mesh, const DracoOptions& options,
                           const VertexData& data, const mesh::Context& context);

  // The largest number of triangles encoded at once, which determines its memory.
  std::size_t most_triangles() const { return most_triangles_; }

 private:
  struct Part {
    std::span<const mesh::Vec3> positions;
    VertexData data;
    std::span<const mesh::Triangle> triangles;
    std::span<const std::uint64_t> layer_vertices;
    std::span<const std::uint64_t> layer_triangles;
  };

  mesh::PartTopology in_mesh(mesh::PartTopology part) const;
  void take(const mesh::Mesh& mesh, const Block& block, const VertexData& data);
  DracoStream encode(const Part& part, const DracoOptions& options, edgebreaker::Threads threads,
                     const mesh::Context& context);

  OwnVertices part_;
  std::vector<std::uint64_t> layer_vertices_;  // of the part
  std::vector<std::uint64_t> layer_triangles_;
  std::size_t most_triangles_ = 0;
  edgebreaker::Encoder encoder_;
};

// A pool of encoders with their memory. Fresh memory costs a fifth of the encoding time, so
// encoders outlive jobs, as the workers' meshes do. Thread safe.
class Encoders {
 public:
  // The process's pool. Idle encoders have together encoded at most kMostIdleTriangles at once,
  // about 250 MiB.
  static Encoders& instance();
  static constexpr std::size_t kMostIdleTriangles = 8'000'000;

  // Returns the idle encoder whose memory fits `triangles` best, or a new one.
  std::unique_ptr<DracoEncoder> take(std::size_t triangles);
  void give_back(std::unique_ptr<DracoEncoder> encoder);

 private:
  Mutex mutex_;
  std::vector<std::unique_ptr<DracoEncoder>> idle_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t idle_triangles_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::codec
