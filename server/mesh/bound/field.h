// The field F = sample - iso-value, scaled, whose zero set is the surface S: linear in each
// tetrahedron of the six-way split (tetrahedra.h); private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/mesh/bound/vec.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/placement.h"

namespace isomesh::mesh::bound {

// How far F must be from zero to have a sign. Values are below 256, and the rounding errors of what
// is computed from them are below 1e-10.
inline constexpr double kMargin = 1e-7;

// Samples inside are positive, the others negative, and none is nearer to zero than 1e-6. With
// midpoint placement they are 1 and -1. Immutable once made, so safe to read from several threads.
struct Field {
  Dims dims;
  std::vector<float> values;  // and one layer more, which is read with a weight of zero

  std::ptrdiff_t step_y() const { return dims.x; }
  std::ptrdiff_t step_z() const { return std::ptrdiff_t{dims.x} * dims.y; }
  Vecd place(std::uint32_t sample) const {
    const std::uint32_t row = sample / dims.x;
    return {static_cast<double>(sample % dims.x), static_cast<double>(row % dims.y),
            static_cast<double>(row / dims.y)};
  }
};

// The ends of a lattice edge that S crosses.
struct Crossing {
  std::uint32_t inside = 0;
  std::uint32_t outside = 0;
};

// Nothing where the samples are too many, or too different, to be told apart in single precision.
template <class T>
std::optional<Field> make_field(const Lattice<T>& lattice, const ExtractOptions& options,
                                const Context& context);

// All crossings in the order in which extraction numbers its vertices.
std::vector<Crossing> crossings_of(const Field& field, const Context& context);

// Where F is zero between the ends, in numbers of samples.
Vecd zero_between(const Field& field, const Crossing& crossing);

// The farthest that a crossing of F is from that of the samples themselves, in millimetres. Both
// surfaces are made of the same triangles, so neither is farther from the other.
template <class T>
double shift_of(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                const std::vector<Crossing>& crossings);

}  // namespace isomesh::mesh::bound
