#include "server/mesh/bound/field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "proto/samples.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {
namespace {

constexpr double kLargest = 256;
constexpr float kLeast = 1e-6F;

template <class T>
double largest_difference(const Lattice<T>& lattice, double iso) {
  const auto [low, high] =
      std::minmax_element(lattice.samples, lattice.samples + lattice.dims.samples());
  return std::max(std::abs(static_cast<double>(*low) - iso),
                  std::abs(static_cast<double>(*high) - iso));
}

// The crossed edges that a sample owns, as bits by their direction 1..7.
unsigned crossed_edges(const Field& field, std::size_t sample, unsigned within) {
  const float* const at = field.values.data() + sample;
  unsigned crossed = 0;
  for (unsigned d = 1; d < 8; ++d) {
    if ((d & ~within) != 0) continue;
    const bool differs = (*at > 0) != (at[sample_offset(field.dims, d)] > 0);
    crossed |= static_cast<unsigned>(differs) << d;
  }
  return crossed;
}

// The directions that stay within the volume.
unsigned steps_within(const Dims& dims, std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return static_cast<unsigned>(x + 1 < dims.x) | static_cast<unsigned>(y + 1 < dims.y) << 1 |
         static_cast<unsigned>(z + 1 < dims.z) << 2;
}

template <class Visit>
void visit_crossings(const Field& field, std::uint32_t z, Visit visit) {
  const Dims& dims = field.dims;
  std::size_t sample = std::size_t{z} * dims.x * dims.y;
  for (std::uint32_t y = 0; y < dims.y; ++y) {
    for (std::uint32_t x = 0; x < dims.x; ++x, ++sample) {
      for (unsigned left = crossed_edges(field, sample, steps_within(dims, x, y, z)); left != 0;
           left &= left - 1) {
        const auto d = static_cast<unsigned>(std::countr_zero(left));
        const auto from = static_cast<std::uint32_t>(sample);
        const auto to = static_cast<std::uint32_t>(static_cast<std::ptrdiff_t>(sample) +
                                                   sample_offset(dims, d));
        visit(field.values[from] > 0 ? Crossing{from, to} : Crossing{to, from});
      }
    }
  }
}

}  // namespace

template <class T>
std::optional<Field> make_field(const Lattice<T>& lattice, const ExtractOptions& options,
                                std::uint32_t margin, const Context& context) {
  const Dims& inner = lattice.dims;
  const Dims dims = {inner.x + 2 * margin, inner.y + 2 * margin, inner.z + 2 * margin};
  if (!inner.has_cells() || dims.samples() > std::numeric_limits<std::uint32_t>::max()) return {};
  const double largest = largest_difference(lattice, options.iso);
  if (!(largest > 0) || std::isinf(largest)) return {};
  const int exponent = std::ilogb(kLargest) - 1 - std::ilogb(largest);
  const bool is_sign = options.interpolation == Interpolation::kMidpoint;
  std::optional<Field> field(std::in_place);
  field->dims = dims;
  field->margin = margin;
  const auto value_of = [&](T sample) {
    const double difference = static_cast<double>(sample) - options.iso;
    const auto scaled = static_cast<float>(std::scalbn(std::abs(difference), exponent));
    const float value = is_sign ? 1 : std::max(scaled, kLeast);
    return static_cast<double>(sample) >= options.iso ? value : -value;
  };
  field->values.assign(dims.samples() + static_cast<std::size_t>(field->step_z()) + dims.x + 2,
                       margin == 0 ? 0 : kPhantom);
  parallel_for(context, inner.z, [&](std::size_t z) {
    const T* from = lattice.samples + z * inner.x * inner.y;
    for (std::size_t y = 0; y < inner.y; ++y, from += inner.x) {
      const std::size_t row = ((z + margin) * dims.y + y + margin) * dims.x + margin;
      std::transform(from, from + inner.x, field->values.begin() + static_cast<std::ptrdiff_t>(row),
                     value_of);
    }
  });
  return field;
}

std::vector<Crossing> crossings_of(const Field& field, const Context& context) {
  std::vector<std::size_t> begin(std::size_t{field.dims.z} + 1, 0);
  parallel_for(context, field.dims.z, [&](std::size_t z) {
    std::size_t count = 0;
    visit_crossings(field, static_cast<std::uint32_t>(z), [&](const Crossing&) { ++count; });
    begin[z + 1] = count;
  });
  for (std::size_t z = 0; z < field.dims.z; ++z) begin[z + 1] += begin[z];
  std::vector<Crossing> crossings(begin.back());
  parallel_for(context, field.dims.z, [&](std::size_t z) {
    Crossing* out = crossings.data() + begin[z];
    visit_crossings(field, static_cast<std::uint32_t>(z),
                    [&](const Crossing& crossing) { *out++ = crossing; });
  });
  return crossings;
}

Vecd zero_between(const Field& field, const Crossing& crossing) {
  const double inside = field.values[crossing.inside];
  const double outside = field.values[crossing.outside];
  const Vecd from = field.place(crossing.inside);
  return from + (field.place(crossing.outside) - from) * (inside / (inside - outside));
}

template <class T>
double shift_of(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                const std::vector<Crossing>& crossings) {
  double most = field.margin == 0 ? 0 : -kLargest / double{kPhantom};
  const Metric metric(lattice.to_space);
  if (options.interpolation == Interpolation::kMidpoint) return most * metric.largest_step();
  const auto difference = [&](std::uint32_t sample) {
    const Vecd at = field.place(sample) - Vecd{1, 1, 1} * field.margin;
    const Dims& inner = lattice.dims;
    const auto number = static_cast<std::size_t>(at.x + inner.x * (at.y + inner.y * at.z));
    return static_cast<double>(lattice.samples[number]) - options.iso;
  };
  for (const Crossing& crossing : crossings) {
    if (field.is_phantom(crossing.outside)) continue;
    const double a = difference(crossing.inside);
    const double b = difference(crossing.outside);
    const double p = field.values[crossing.inside];
    const double q = field.values[crossing.outside];
    const double moved = std::abs(a / (a - b) - p / (p - q));
    if (moved <= most) continue;
    most = moved;
  }
  return most * metric.largest_step() * (1 + 1e-6);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                          \
  template std::optional<Field> make_field(const Lattice<T>&, const ExtractOptions&, \
                                           std::uint32_t, const Context&);           \
  template double shift_of(const Lattice<T>&, const ExtractOptions&, const Field&,   \
                           const std::vector<Crossing>&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh::bound
