// The samples of an extraction at an iso-value behind one interface for all types, so that the walk
// over them is compiled once and not once for each type; private to the kernels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "server/mesh/lattice/border.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/lattice/tetrahedra.h"

namespace isomesh::mesh {

// The samples at the ends of an edge, as offsets from the sample that names it.
struct EdgeSamples {
  std::ptrdiff_t from = 0;
  std::ptrdiff_t to = 0;
};

// Crossed edges that samples of one row name. Each is a place: `places` x + its number, where
// x - `margin` is the sample's number in the lattice's own row (y, z).
struct RowEdges {
  std::uint32_t y = 0;
  std::uint32_t z = 0;
  std::uint32_t margin = 0;
  std::uint32_t places = 0;           // a sample, a power of two
  unsigned parity = 0;                // of the sample x = 0
  const EdgeSamples* ends = nullptr;  // of each number, those of even samples first
  std::span<const std::uint32_t> edges;
};

// The same on the body-centred lattice (bcc_faces.h). An end may be a centre, whose cell begins at
// the sample.
struct BccEdgeSamples {
  std::ptrdiff_t from = 0;
  std::ptrdiff_t to = 0;
  bool is_from_centre = false;
  bool is_to_centre = false;
};

// Crossed edges of the body-centred lattice. Each is a place as in RowEdges, of kBccPlaces a
// sample. Those of one sample are best together.
struct BccRowEdges {
  std::uint32_t y = 0;
  std::uint32_t z = 0;
  std::uint32_t margin = 0;
  const BccEdgeSamples* ends = nullptr;  // of each number
  std::span<const std::uint32_t> edges;
};

// Immutable, so safe to read from several threads. Rows are in the lattice's own numbers.
class SampleRows {
 public:
  virtual ~SampleRows() = default;

  // Sets the bits of a row's samples that are inside, 64 a word, the lowest bit the smallest x. The
  // other bits of the row's words are zero then.
  virtual void classify(std::uint32_t y, std::uint32_t z, std::uint64_t* out) const = 0;

  // The places of a row's samples [begin, begin + count) in the order of nearness to the iso-value:
  // by the distance of their values from it in single precision, and values of at least the
  // iso-value first of those that are equally near. Only places on different sides can be compared.
  // They are signed integers of rank_bytes() each: 1, 2 or 4.
  virtual void nearness(std::uint32_t y, std::uint32_t z, std::uint32_t begin, std::size_t count,
                        std::byte* out) const = 0;

  // Like nearness(), but for the centres of cells.
  virtual void centre_nearness(std::uint32_t y, std::uint32_t z, std::uint32_t begin,
                               std::size_t count, std::byte* out) const = 0;

  virtual std::size_t rank_bytes() const = 0;

  // How far the surface is along each edge from its first end, as a share of the edge.
  virtual void shares(const RowEdges& row, double* out) const = 0;

  // Sets those bits of `out` whose cells' means of eight samples are inside, of the cells that are
  // in `uncertain`. Bit x is the cell that begins at sample x - `margin` of the row (cell_mean.h).
  virtual void add_centres(std::uint32_t y, std::uint32_t z, std::uint32_t margin,
                           std::span<const std::uint64_t> uncertain, std::uint64_t* out) const = 0;

  // Like shares(), but on the body-centred lattice.
  virtual void bcc_shares(const BccRowEdges& row, double* out) const = 0;

  // Like BorderPlacement::place. Only for a closed surface.
  virtual BorderVertex place_at_border(const BorderSample& cell, const EdgeEnds& ends) const = 0;
};

// `lattice` must outlive what is returned.
template <class T>
std::unique_ptr<const SampleRows> make_sample_rows(const Lattice<T>& lattice,
                                                   const ExtractOptions& options,
                                                   const Threshold<T>& threshold);

}  // namespace isomesh::mesh
