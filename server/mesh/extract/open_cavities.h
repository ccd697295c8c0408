// Cavities that voxels close, and that the surface leaves open.
//
// A wall of one or two voxels has places where the samples on its sides touch across it, at an edge
// or a corner of their voxels. The surface has a hole there if an edge of the lattice joins the
// two:
//
//  * six tetrahedra: the edges along the axes, the diagonals of faces and the long diagonal of a
//    cell from the lower to the higher index. The longest has sqrt(3) steps;
//  * five tetrahedra: the edges along the axes, and both diagonals of faces between samples of even
//    i+j+k. The longest has sqrt(2) steps;
//  * the body-centred lattice: the edges along the axes, and those over centres of cells. A centre
//    is on the side of the mean of its cell's eight samples.
//
// All of them have the edges along the axes, so what voxels join face to face is never apart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/placement.h"

namespace isomesh::mesh {

// The signs of samples, a bit each, 64 a word, the lowest bit the smallest x. Other bits of a row's
// words are zero. Both functions are called from several threads.
struct SignRows {
  Dims dims;
  unsigned parity = 0;  // of i+j+k of the first sample
  // Sets the bits of the row (y, z) that are inside.
  std::function<void(std::uint32_t y, std::uint32_t z, std::uint64_t* out)> classify;
  // Sets those bits of the cells' centres that are inside, of the cells in `uncertain`, which begin
  // at the samples of the row. Only for the body-centred lattice.
  std::function<void(std::uint32_t y, std::uint32_t z, std::span<const std::uint64_t> uncertain,
                     std::uint64_t* out)>
      add_centres = {};
};

// Those at an iso-value; only iso and what is inside of the options count. `lattice` must outlive
// them. `classify` is empty if no sample can be inside.
template <class T>
SignRows sign_rows(const Lattice<T>& lattice, const ExtractOptions& options);

// Outside samples that share faces of voxels are one region. A region is a cavity if none of its
// samples lies on the border of the volume and it has at least so many of them: pits of a sample or
// two in a rough surface are none.
inline constexpr std::uint64_t kLeastCavity = 8;

// The most starts of regions: runs of outside samples with no run beside them in the rows before. A
// region has at least one. With more of them the samples are noise, and nothing is counted, so that
// memory is bounded.
inline constexpr std::size_t kMostRegionStarts = std::size_t{1} << 20;

// The most bytes of runs that a search holds between slabs of 32 planes: those of the planes at
// both of their ends, and of centres beside them. A volume of 2048 x 2048 x 2048 samples has so
// many with 42 runs a row. With more of them nothing is counted. Each thread also has the runs of
// up to five planes.
inline constexpr std::size_t kMostRunBytes = std::size_t{1} << 27;

struct CavityCount {
  struct Open {
    std::uint64_t cavities = 0;
    std::uint64_t samples = 0;  // of those

    bool operator==(const Open&) const = default;
  };

  std::uint64_t cavities = 0;
  std::vector<Open> open = {};  // of each scheme: joined to the border over outside samples

  bool operator==(const CavityCount&) const = default;
};

// Counts the cavities, and those that each of the schemes leaves open. The signs alone decide that.
// None in noise, see kMostRegionStarts and kMostRunBytes. Does not depend on the number of threads.
// Throws Error kCancelled.
CavityCount count_cavities(const SignRows& rows, std::span<const Scheme> schemes,
                           const Context& context);

// The planes that a thread has at a time.
inline constexpr std::uint64_t kCavityPlanes = 6;

// The sizes that bound the memory of searches.
struct CavitySearches {
  Dims dims;                   // of the largest
  std::uint64_t vertices = 0;  // of all surfaces
  // The most in kCavityPlanes planes that follow each other, and the one behind them.
  std::uint64_t vertices_at_work = 0;
  std::size_t schemes = 1;
  std::uint64_t at_once = 1;  // searches
};

// An upper estimate of the memory of `count_cavities` in bytes, with the present number of threads.
// Two vertices of a surface, or the border, end each run, so a smooth surface has few.
std::uint64_t cavity_search_memory(const CavitySearches& searches);

// True if the samples have two values, as a mask has. A third value ends the search.
template <class T>
bool is_mask(const Lattice<T>& lattice, const Context& context);

}  // namespace isomesh::mesh
