// The passes over one slab of labels, as slabs.h has them for an iso-value; private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "server/mesh/extract/slabs.h"
#include "server/mesh/labels/label_index.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/labels/wall_cases.h"

namespace isomesh::mesh {

// Returns the scheme. Throws Error kInvalidParameter for one that labels do not have.
Scheme scheme_of_labels(Scheme scheme);

// Data that all slabs share when labels are separated. Phantoms are background.
struct Separation : Marching {
  template <class T>
  Separation(const Lattice<T>& lattice, const SeparateOptions& options)
      : Marching(lattice.dims, lattice.to_space, scheme_of_labels(options.scheme), options.close),
        regularize(options.regularize),
        parts(options.labels, options.values),
        samples(std::make_unique<PartsOf<T>>(lattice, parts)),
        walls({make_wall_cases(options.scheme, false, to_space.determinant() < 0),
               make_wall_cases(options.scheme, true, to_space.determinant() < 0)}) {}

  bool regularize;
  LabelParts parts;
  std::unique_ptr<const SampleParts> samples;
  std::array<WallCases, 2> walls;          // by parity, wound for the lattice
  std::span<const ClusterLayer> clusters;  // of walls that are regularised, when they are written
};

void count_slab(const Separation& separation, const Slab& slab, SurfaceCount& count);

void write_slab(const Separation& separation, const Slab& slab, IndexMemory& memory,
                SeparatingSurface& surface);

}  // namespace isomesh::mesh
