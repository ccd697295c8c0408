// Our own encoder of Draco streams, for what isomesh makes: oriented manifolds of triangles with
// positions and, if need be, normals. It writes bitstream 2.2: standard edgebreaker (Rossignac,
// "Edgebreaker: connectivity compression for triangle meshes", 1999), positions quantised on a
// grid, predicted by parallelograms (Touma and Gotsman, 1998), entropy coded by rANS. Every Draco
// decoder reads it.
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
  // In the surface's numbers of vertices; none where there is a vertex that no triangle names.
  std::optional<mesh::PartTopology> topology;
};

// The triangles in layers, as mesh::Mesh has them: a triangle of layer k names only vertices of
// layers k and k + 1. The offsets are layers + 1 each, and ascend from 0 to the numbers of vertices
// and of triangles; others are taken as one layer.
struct Surface {
  std::span<const mesh::Vec3> positions;
  std::span<const mesh::Triangle> triangles;
  std::span<const std::uint64_t> layer_vertices;
  std::span<const std::uint64_t> layer_triangles;
  std::span<const mesh::Vec3> normals = {};  // unit vectors, of each position; or none

  std::size_t layers() const { return layer_vertices.size() - 1; }
};

// Of each octahedral coordinate of a normal: a tenth of a degree.
inline constexpr int kNormalBits = 10;

// The attributes' ids within a stream.
inline constexpr std::uint32_t kPositionId = 0;
inline constexpr std::uint32_t kNormalId = 1;

enum class Threads {
  kOne,  // only the calling one
  kAll,  // the arena's, of which few are of use
};

// Encodes one surface after the other in memory that it keeps: some 32 bytes a triangle, and for
// each thread a cache line for each vertex of two layers. Not thread safe.
class Encoder {
 public:
  static constexpr int kMostPositionBits = 16;

  // While at least this many faces are not encoded yet, a component's start is looked for from
  // which two threads can go through it. The bytes depend on it; tests look ahead in small
  // surfaces.
  static constexpr std::size_t kLeastToLookAhead = 200'000;

  explicit Encoder(std::size_t least_to_look_ahead = kLeastToLookAhead);
  ~Encoder();
  Encoder(Encoder&&) noexcept;
  Encoder& operator=(Encoder&&) noexcept;

  // The stream of all triangles with the vertices that they name; each triangle keeps its
  // orientation, each position is moved by at most half a step of the grid along each axis. Same
  // bytes whatever the threads and the layers. A vertex at which several open fans meet becomes one
  // for each.
  //
  // None where the surface is not covered: no triangles, or more than 2^28; a grid of more than 16
  // bits, or a position that is not on it, or not a number; a triangle that repeats a vertex or
  // names one that is not of its layers; an edge of more than two triangles, or of two in the same
  // sense; a vertex with a closed fan besides another.
  //
  // Throws Error kCancelled.
  std::optional<Encoded> encode(const Surface& surface, const Grid& grid, Threads threads,
                                const mesh::Context& context);

 private:
  class Stages;
  std::unique_ptr<Stages> stages_;
};

}  // namespace isomesh::codec::edgebreaker
