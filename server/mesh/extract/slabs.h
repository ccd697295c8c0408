// The first and the third pass of extraction on one slab of layers, compiled for several
// instruction sets of which the best is chosen when the program runs; private to the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/mutex.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/sample_rows.h"
#include "server/mesh/lattice/tetrahedra.h"

namespace isomesh::mesh {

// A run of layers that one task works on.
struct Slab {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
  std::uint32_t first_layer = 0;  // that is the first of the mesh which is written
};

// How many layers of phantoms are around the volume.
inline std::uint32_t margin_of(bool close) { return close ? 1 : 0; }

// The samples that are marched over: the lattice's, and the phantoms around them.
inline Dims marched_dims(const Dims& dims, bool close) {
  const std::uint32_t more = 2 * margin_of(close);
  return {dims.x + more, dims.y + more, dims.z + more};
}

// The ways to split cells of even and odd parity, wound for the lattice.
std::array<CellSplit, 2> splits_of(Scheme scheme, bool left_handed);

// The lattice that is marched over. Phantoms are numbered too, so the lattice's own samples begin
// at `margin`. Immutable while slabs are processed.
struct Marching {
  Marching(const Dims& samples, const LatticeToSpace& map, Scheme the_scheme, bool close)
      : to_space(map),
        margin(margin_of(close)),
        dims(marched_dims(samples, close)),
        scheme(the_scheme),
        splits(splits_of(the_scheme, map.determinant() < 0)) {}

  // 0 or 1: whether i+j+k is even or odd, in the lattice's own numbers, of the cell or sample that
  // is (x, y, z) when phantoms are numbered too.
  unsigned parity(std::size_t x, std::size_t y, std::size_t z) const {
    return (x + y + z + margin) & 1;
  }

  LatticeToSpace to_space;
  std::uint32_t margin;
  Dims dims;  // of what is marched over
  Scheme scheme;
  std::array<CellSplit, 2> splits;
};

// Data that all slabs of an extraction at an iso-value share.
struct Extraction : Marching {
  template <class T>
  Extraction(const Lattice<T>& lattice, const ExtractOptions& options,
             const Threshold<T>& threshold)
      : Marching(lattice.dims, lattice.to_space, options.scheme, options.close),
        inner(lattice.dims),
        is_midpoint(options.interpolation == Interpolation::kMidpoint),
        regularize(options.regularize),
        samples(make_sample_rows(lattice, options, threshold)) {}

  // Prepares for a surface that is regularised, when it is written.
  void keep(std::span<const ClusterLayer> joining) {
    clusters = joining;
    placed.push_back(placed_triangles(splits.front()));
    if (scheme == Scheme::kFive) placed.push_back(placed_triangles(splits.back()));
  }

  Dims inner;  // of the lattice itself
  bool is_midpoint;
  bool regularize;
  std::unique_ptr<const SampleRows> samples;
  std::span<const ClusterLayer> clusters;
  // The triangles of cells of even parity and, if they differ, of odd parity.
  std::vector<PlacedTriangles> placed;
};

// The memory that a slab numbers its vertices in. A slab that has ended gives its block back and
// the next one takes it, so that pages are mapped once for each thread, not for each slab. Thread
// safe.
class IndexMemory {
 public:
  explicit IndexMemory(std::size_t count) : count_(count) {}

  using Block = std::unique_ptr<std::uint32_t[]>;

  Block take() {
    const Lock lock(mutex_);
    if (free_.empty()) return std::make_unique_for_overwrite<std::uint32_t[]>(count_);
    Block block = std::move(free_.back());
    free_.pop_back();
    return block;
  }

  void give_back(Block block) {
    const Lock lock(mutex_);
    free_.push_back(std::move(block));
  }

 private:
  const std::size_t count_;
  Mutex mutex_;
  std::vector<Block> free_ ISOMESH_GUARDED_BY(mutex_);
};

// Places a sample, by direction, for the indices of the vertices on the edges that it owns.
inline constexpr std::size_t kEdgePlaces = 8;

// How many indices a slab works with that marches over such samples: those of one plane and two
// rows, of so many places a sample.
inline std::size_t index_memory_size(const Dims& dims, std::size_t places) {
  return (std::size_t{dims.y} + 2) * dims.x * places;
}

// Pass 1, count: how many vertices and triangles layer k has goes to layer_vertices[k + 1] and
// layer_triangles[k + 1]. Calls ended(k) when clusters[k] is complete.
using LayerEnded = std::function<void(std::uint32_t)>;
void count_slab(const Extraction& extraction, const Slab& slab, SurfaceCount& count,
                const LayerEnded& ended = {});

// Pass 3, write: the slab's vertices and triangles go to their places, which mesh.layer_vertices
// and mesh.layer_triangles tell. Reads joined crossings of the planes [begin, end + 2), and of the
// next plane those of the first row: kJoinedLayersBehind.
void write_slab(const Extraction& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh);

}  // namespace isomesh::mesh
