// Our own encoder of Draco streams for oriented manifolds of triangles with positions and optional
// normals. It writes bitstream 2.2, which every Draco decoder reads: standard edgebreaker
// (Rossignac, "Edgebreaker: connectivity compression for triangle meshes", 1999), positions
// quantised on a grid, predicted by parallelograms (Touma and Gotsman, 1998), entropy coded by
// rANS.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/codec/draco/grid.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology_parts.h"

namespace isomesh::codec::edgebreaker {

struct Encoded {
  std::vector<std::byte> bytes;
  std::uint32_t vertices = 0;
  // In the surface's vertex numbers; empty if a vertex is in no triangle.
  std::optional<mesh::PartTopology> topology;
};

// The triangles in layers, as in mesh::Mesh: a triangle of layer k has only vertices of layers k
// and k + 1. Each array of offsets has layers + 1 elements and ascends from 0 to the number of
// vertices or triangles; other arrays are treated as one layer.
struct Surface {
  std::span<const mesh::Vec3> positions;
  std::span<const mesh::Triangle> triangles;
  std::span<const std::uint64_t> layer_vertices;
  std::span<const std::uint64_t> layer_triangles;
  std::span<const mesh::Vec3> normals = {};  // unit vectors, one per position, or empty

  std::size_t layers() const { return layer_vertices.size() - 1; }
};

// Bits of each octahedral coordinate of a normal: precise to a tenth of a degree.
inline constexpr int kNormalBits = 10;

inline constexpr std::uint32_t kPositionId = 0;
inline constexpr std::uint32_t kNormalId = 1;

enum class Threads {
  kOne,  // the calling thread only
  kAll,  // those of the arena, of which a few help
};

// Encodes surfaces in memory that it keeps between calls: about 32 bytes per triangle, and for each
// thread a cache line per vertex of two layers. Not thread safe.
class Encoder {
 public:
  static constexpr int kMostPositionBits = 16;

  // While at least this many faces remain, LookAhead searches a component's start that lets two
  // threads traverse it. The bytes depend on it. Tests use small values.
  static constexpr std::size_t kLeastToLookAhead = 200'000;

  explicit Encoder(std::size_t least_to_look_ahead = kLeastToLookAhead);
  ~Encoder();
  Encoder(Encoder&&) noexcept;
  Encoder& operator=(Encoder&&) noexcept;

  // Encodes all triangles and their vertices. Each triangle keeps its orientation; each position
  // moves by at most half a grid step along each axis. The bytes depend neither on the threads nor
  // on the layers. A vertex shared by several open fans is duplicated for each.
  //
  // Returns empty for unsupported surfaces: no triangles, or more than 2^28; a grid of more than 16
  // bits; a position that is NaN or off the grid; a triangle that repeats a vertex or has one of
  // other layers; an edge of more than two triangles, or of two in the same direction; a vertex
  // with a closed fan and another one.
  //
  // Throws Error kCancelled.
  std::optional<Encoded> encode(const Surface& surface, const Grid& grid, Threads threads,
                                const mesh::Context& context);

 private:
  class Stages;
  std::unique_ptr<Stages> stages_;
};

}  // namespace isomesh::codec::edgebreaker
