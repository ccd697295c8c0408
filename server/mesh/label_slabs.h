// The passes over one slab of labels, as slabs.h has them for an iso-value; private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "server/mesh/label_index.h"
#include "server/mesh/separate.h"
#include "server/mesh/slabs.h"
#include "server/mesh/wall_cases.h"

// Writes X(type of C++, name) once for each type of sample that a label can have.
#define ISOMESH_FOR_EACH_LABEL_TYPE(X) \
  X(std::uint8_t, uint8)               \
  X(std::int8_t, int8)                 \
  X(std::uint16_t, uint16)             \
  X(std::int16_t, int16)               \
  X(std::uint32_t, uint32)             \
  X(std::int32_t, int32)

namespace isomesh::mesh {

// What all slabs share whose labels are separated. Phantoms are background.
template <class T>
struct Separation : Marching<T> {
  Separation(const Lattice<T>& the_lattice, const SeparateOptions& options)
      : Marching<T>(the_lattice, options.scheme, options.close),
        parts(options.labels, options.values),
        index(parts) {
    const bool left_handed = the_lattice.to_space.determinant() < 0;
    walls = {make_wall_cases(options.scheme, false, left_handed),
             make_wall_cases(options.scheme, true, left_handed)};
  }

  LabelParts parts;
  LabelIndex<T> index;
  std::array<WallCases, 2> walls;  // by parity, wound for the lattice
};

template <class T>
void count_slab(const Separation<T>& separation, const Slab& slab, SurfaceCount& count);

// Adds to the place of each label's number how many of the slab's triangles have it on either side.
template <class T>
void tally_slab(const Separation<T>& separation, const Slab& slab,
                std::span<std::uint64_t> triangles);

template <class T>
void write_slab(const Separation<T>& separation, const Slab& slab, IndexMemory& memory,
                SeparatingSurface& surface);

}  // namespace isomesh::mesh
