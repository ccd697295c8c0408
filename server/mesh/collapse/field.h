// The field F = sample - iso-value, or its negative where lower samples are inside, scaled, whose
// zero set is the surface S: linear in each tetrahedron of the five- or six-way split
// (tetrahedra.h), or of the body-centred lattice (bcc_faces.h); private to this folder.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/mesh/collapse/vec.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/placement.h"

namespace isomesh::mesh::collapse {

// How far F must be from zero to have a sign. The rounding errors of what is computed from values
// below 256 are below 1e-10, and beside phantoms below 1e-8.
inline constexpr double kMargin = 1e-7;
inline constexpr float kPhantom = -4194304;  // -2^22
inline constexpr float kNoCentre = 0;        // of a cell that has none

// Points are samples and, on the body-centred lattice, centres of cells. Those inside are positive,
// the others negative, and none is nearer to zero than 1e-6. With midpoint placement they are 1 and
// -1. Around a surface that is closed there are some layers of kPhantom, so that it ends that
// little outside of the volume: see shift_of. Immutable once made, so safe to read from several
// threads.
struct Field {
  Dims dims;                 // with the layers around the volume
  std::uint32_t margin = 0;  // how many those are on each side
  Scheme scheme = Scheme::kSix;
  // One for each point: first those of the samples, and one layer more, read with a weight of
  // zero. The centre of the cell whose corner 0 is sample s is point s + first_centre.
  std::vector<float> values;
  std::uint32_t first_centre = ~std::uint32_t{0};

  std::ptrdiff_t step_y() const { return dims.x; }
  std::ptrdiff_t step_z() const { return std::ptrdiff_t{dims.x} * dims.y; }
  bool contains(Vecf p) const {
    const auto is_within = [](float x, std::uint32_t samples) {
      return x >= 0 && x <= static_cast<float>(samples - 1);
    };
    return is_within(p.x, dims.x) && is_within(p.y, dims.y) && is_within(p.z, dims.z);
  }
  // True if a place is strictly between the faces of the volume.
  bool encloses(Vecf p) const {
    const auto is_between = [this](float x, std::uint32_t samples) {
      return x > static_cast<float>(margin) && x < static_cast<float>(samples - 1 - margin);
    };
    return is_between(p.x, dims.x) && is_between(p.y, dims.y) && is_between(p.z, dims.z);
  }
  bool is_phantom(std::uint32_t point) const { return values[point] == kPhantom; }
  bool is_centre(std::uint32_t point) const { return point >= first_centre; }
  Vecd place(std::uint32_t point) const {
    const std::uint32_t sample = is_centre(point) ? point - first_centre : point;
    const std::uint32_t row = sample / dims.x;
    const double half = is_centre(point) ? 0.5 : 0;
    return Vecd{static_cast<double>(sample % dims.x), static_cast<double>(row % dims.y),
                static_cast<double>(row / dims.y)} +
           Vecd{half, half, half};
  }
};

// F at a place in the volume.
double value_at(const Field& field, Vecf place);

// The ends of a lattice edge that S crosses.
struct Crossing {
  std::uint32_t inside = 0;
  std::uint32_t outside = 0;
};

// `margin`: more than 0 where the surface is closed. Nothing where the samples are too many, or too
// different, to be told apart in single precision.
template <class T>
std::optional<Field> make_field(const Lattice<T>& lattice, const ExtractOptions& options,
                                std::uint32_t margin, const Context& context);

// All crossings, in the order in which extraction numbers its vertices: by the samples that own
// their edges, and by direction or slot.
struct Crossings {
  std::vector<Crossing> all;
  std::vector<std::size_t> layer_begin;  // of those that a plane's samples own, and the end
};

Crossings crossings_of(const Field& field, const Context& context);

// Makes S consist of some of its components: those of the crossings whose bits are set in `kept`
// (Mesh::kept). A component of S parts the volume, and has a tetrahedron that it crosses for
// itself. So where it is left out, F keeps its size and takes the other sign on one side. Returns a
// flag for each crossing that is left: set if its ends have changed their signs, so that triangles
// of S now face the inside. Empty: none has.
std::vector<std::uint8_t> leave_out(std::span<const std::uint64_t> kept, const Context& context,
                                    Field& field, Crossings& crossings);

// The numbers of the crossings that one plane's samples own.
class PlaneCrossings {
 public:
  PlaneCrossings(const Field& field, const Crossings& crossings, std::uint32_t z);

  // The number of the crossing on a sample's edge of a direction 1..7, or of a slot, which must be
  // crossed. The sample must be one of this plane.
  bool is_crossed(std::size_t sample, unsigned edge) const {
    return (samples_[sample - begin_].set >> edge & 1) != 0;
  }
  std::uint32_t number_of(std::size_t sample, unsigned edge) const {
    const Sample& owner = samples_[sample - begin_];
    const unsigned before = owner.set & ((1U << edge) - 1);
    return owner.first + static_cast<std::uint32_t>(std::popcount(before));
  }

 private:
  struct Sample {
    std::uint32_t first = 0;
    std::uint32_t set = 0;
  };

  const std::size_t begin_;
  std::vector<Sample> samples_;
};

// The point between the ends where F is zero, in numbers of samples.
Vecd zero_between(const Field& field, const Crossing& crossing);

// How far S is at most from the surface of the samples themselves, in millimetres: the farthest
// that a crossing of F is from the vertex of theirs, which keeps away from samples, since both are
// made of the same triangles. The caps of a closed surface are where it leaves the volume: those of
// S are farther out by what F rises between a sample and a phantom.
template <class T>
double shift_of(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                std::span<const Crossing> crossings, const Context& context);

}  // namespace isomesh::mesh::collapse
