// Extraction's work on one slab of layers, compiled for several instruction sets of which the best
// is chosen when the program runs; private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "server/mesh/extract.h"
#include "server/mesh/placement.h"
#include "server/mesh/tetrahedra.h"

namespace isomesh::mesh {

// A run of layers that one task works on.
struct Slab {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
};

// What all slabs of an extraction share. Immutable while they are worked on.
template <class T>
struct Extraction {
  Extraction(const Lattice<T>& the_lattice, const ExtractOptions& options, T the_smallest);

  const Lattice<T>& lattice;
  Scheme scheme;
  T smallest;  // the smallest value that is inside
  Placement placement;
  std::array<CellSplit, 2> splits;  // of cells of even and of odd x + y + z, wound for the lattice
};

// Memory that slabs work in, lent to one of them at a time: its pages are mapped once a thread, not
// once a slab. Thread safe.
class IndexMemory {
 public:
  explicit IndexMemory(std::size_t count) : count_(count) {}

  using Block = std::unique_ptr<std::uint32_t[]>;

  Block take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique_for_overwrite<std::uint32_t[]>(count_);
    Block block = std::move(free_.back());
    free_.pop_back();
    return block;
  }

  void give_back(Block block) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(block));
  }

 private:
  const std::size_t count_;
  std::mutex mutex_;
  std::vector<Block> free_;  // guarded by mutex_
};

// Places a sample, by direction, for the indices of the vertices on the edges that it owns.
inline constexpr std::size_t kPlaces = 8;

// How many indices a slab of such a lattice works with: those of one plane and two rows.
inline std::size_t index_memory_size(const Dims& dims) {
  return (std::size_t{dims.y} + 2) * dims.x * kPlaces;
}

// Writes the numbers of vertices and triangles of layer k to layer_vertices[k + 1] and
// layer_triangles[k + 1].
template <class T>
void count_slab(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count);

// Writes the slab's vertices and triangles to their places, which mesh.layer_vertices and
// mesh.layer_triangles tell.
template <class T>
void write_slab(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh);

}  // namespace isomesh::mesh
