#include "server/mesh/collapse/field.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "proto/samples.h"
#include "server/mesh/lattice/border.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
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

// Calls visit(sample, its crossed edges as bits by their direction 1..7, the split of its cell) for
// those of a layer that own any. A sample's edges lie in the cell whose corner 0 it is.
template <class Visit>
void visit_crossed(const Field& field, std::uint32_t z, Visit visit) {
  const Dims& dims = field.dims;
  std::size_t sample = std::size_t{z} * dims.x * dims.y;
  for (std::uint32_t y = 0; y < dims.y; ++y) {
    const float* const row = field.values.data() + sample;
    // The signs at the four corners of cells that have this x: those of the larger x, and of the
    // smaller one once they are shifted.
    const auto signs_at = [&](std::ptrdiff_t x) {
      const auto sign = [&](unsigned c) {
        return static_cast<unsigned>(row[x + sample_offset(dims, c)] > 0) << (c + 1);
      };
      return sign(0) | sign(2) | sign(4) | sign(6);
    };
    const unsigned steps = (y + 1 < dims.y ? 0b010U : 0U) | (z + 1 < dims.z ? 0b100U : 0U);
    unsigned signs = signs_at(0);
    for (std::uint32_t x = 0; x < dims.x; ++x, ++sample) {
      signs = (signs >> 1 & 0b01010101U) | signs_at(std::ptrdiff_t{x} + 1);
      if (signs == 0 || signs == 0xFF) continue;
      const CellSplit& split = cell_split(field.scheme, ((x + y + z) & 1) != 0);
      const unsigned outside = ~(steps | (x + 1 < dims.x ? 1U : 0U));
      unsigned set = 0;
      for (unsigned left = split.crossed[signs]; left != 0; left &= left - 1) {
        const auto d = static_cast<unsigned>(std::countr_zero(left));
        if ((d & outside) == 0) set |= 1U << d;
      }
      if (set != 0) visit(sample, set, split);
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
  field->scheme = options.scheme;
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

Crossings crossings_of(const Field& field, const Context& context) {
  Crossings crossings;
  std::vector<std::size_t>& begin = crossings.layer_begin;
  begin.assign(std::size_t{field.dims.z} + 1, 0);
  parallel_for(context, field.dims.z, [&](std::size_t z) {
    std::size_t count = 0;
    visit_crossed(field, static_cast<std::uint32_t>(z),
                  [&](std::size_t, unsigned set, const CellSplit&) {
                    count += static_cast<std::size_t>(std::popcount(set));
                  });
    begin[z + 1] = count;
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  crossings.all.resize(begin.back());
  parallel_for(context, field.dims.z, [&](std::size_t z) {
    Crossing* out = crossings.all.data() + begin[z];
    visit_crossed(field, static_cast<std::uint32_t>(z),
                  [&](std::size_t sample, unsigned set, const CellSplit& split) {
                    for (; set != 0; set &= set - 1) {
                      const EdgeEnds& ends =
                          split.ends[static_cast<unsigned>(std::countr_zero(set))];
                      const auto end = [&](unsigned corner) {
                        return static_cast<std::uint32_t>(static_cast<std::ptrdiff_t>(sample) +
                                                          sample_offset(field.dims, corner));
                      };
                      const bool is_inside = field.values[end(ends.from)] > 0;
                      *out++ = is_inside ? Crossing{end(ends.from), end(ends.to)}
                                         : Crossing{end(ends.to), end(ends.from)};
                    }
                  });
  });
  return crossings;
}

std::vector<std::uint8_t> leave_out(std::span<const std::uint64_t> kept, const Context& context,
                                    Field& field, Crossings& crossings) {
  const Dims dims = field.dims;
  const std::size_t plane = std::size_t{dims.x} * dims.y;
  // A sample is turned if a way from the first one crosses what is left out an odd number of times:
  // any way, here along z, then y, then x.
  std::vector<std::vector<bool>> is_turned(dims.z, std::vector<bool>(plane, false));
  std::vector<std::uint8_t> next_turns(dims.z, 0);  // between planes
  parallel_for(context, dims.z, [&](std::size_t z) {
    std::vector<bool>& turned = is_turned[z];
    std::size_t number = crossings.layer_begin[z];
    visit_crossed(field, static_cast<std::uint32_t>(z),
                  [&](std::size_t sample, unsigned set, const CellSplit&) {
                    const std::size_t at = sample - z * plane;
                    for (; set != 0; set &= set - 1, ++number) {
                      if ((kept[number / kFlagBits] >> (number % kFlagBits) & 1) != 0) continue;
                      const auto direction = static_cast<unsigned>(std::countr_zero(set));
                      if (direction == 1) turned[at + 1] = true;
                      if (direction == 2 && at % dims.x == 0) turned[at + dims.x] = true;
                      if (direction == 4 && at == 0) next_turns[z] = 1;
                    }
                  });
    for (std::size_t y = 1; y < dims.y; ++y) {
      turned[y * dims.x] = turned[y * dims.x] != turned[(y - 1) * dims.x];
    }
    for (std::size_t at = 0; at < plane; ++at) {
      if (at % dims.x != 0) turned[at] = turned[at] != turned[at - 1];
    }
  });
  bool is_plane_turned = false;
  for (std::size_t z = 0; z < dims.z; ++z) {
    if (is_plane_turned) is_turned[z].flip();
    is_plane_turned = is_plane_turned != (next_turns[z] != 0);
  }
  parallel_for(context, dims.z, [&](std::size_t z) {
    float* const values = field.values.data() + z * plane;
    for (std::size_t at = 0; at < plane; ++at) {
      if (is_turned[z][at]) values[at] = -values[at];
    }
  });
  crossings = crossings_of(field, context);
  std::vector<std::uint8_t> flags(crossings.all.size(), 0);
  for_each(context, flags.size(), [&](std::size_t v) {
    const std::uint32_t inside = crossings.all[v].inside;
    flags[v] = is_turned[inside / plane][inside % plane] ? 1 : 0;
  });
  if (std::ranges::find(flags, 1) == flags.end()) flags.clear();
  return flags;
}

PlaneCrossings::PlaneCrossings(const Field& field, const Crossings& crossings, std::uint32_t z)
    : begin_(std::size_t{z} * field.dims.x * field.dims.y),
      samples_(std::size_t{field.dims.x} * field.dims.y) {
  auto next = static_cast<std::uint32_t>(crossings.layer_begin[z]);
  visit_crossed(field, z, [&](std::size_t sample, unsigned set, const CellSplit&) {
    samples_[sample - begin_] = {next, set};
    next += static_cast<std::uint32_t>(std::popcount(set));
  });
}

Vecd zero_between(const Field& field, const Crossing& crossing) {
  const double inside = field.values[crossing.inside];
  const double outside = field.values[crossing.outside];
  const Vecd from = field.place(crossing.inside);
  return from + (field.place(crossing.outside) - from) * (inside / (inside - outside));
}

template <class T>
double shift_of(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                std::span<const Crossing> crossings, const Context& context) {
  const Metric metric(lattice.to_space);
  const double of_caps =
      field.margin == 0 ? 0 : -kLargest / double{kPhantom} * metric.largest_step();
  if (options.interpolation == Interpolation::kMidpoint) return of_caps;
  const auto difference = [&](std::uint32_t sample) {
    const Vecd at = field.place(sample) - Vecd{1, 1, 1} * field.margin;
    const Dims& inner = lattice.dims;
    const auto number = static_cast<std::size_t>(at.x + inner.x * (at.y + inner.y * at.z));
    return static_cast<double>(lattice.samples[number]) - options.iso;
  };
  // Vertices keep away from samples.
  const double nearest = Placement::nearest_share(lattice.dims, lattice.to_space);
  const double kept = field.margin == 0 ? nearest : nearest_on_border(nearest);
  std::vector<double> most(chunks_of(crossings.size()), of_caps);
  for_chunks(context, crossings.size(), [&](std::size_t begin, std::size_t end) {
    double& farthest = most[begin / kChunk];
    for (const auto& [inside, outside] : crossings.subspan(begin, end - begin)) {
      if (field.is_phantom(outside)) continue;
      const double a = difference(inside);
      const double b = difference(outside);
      const double p = field.values[inside];
      const double q = field.values[outside];
      // The difference of two doubles can overflow; that of their halves cannot.
      const double share = std::isinf(a - b) ? (a / 2) / (a / 2 - b / 2) : a / (a - b);
      const double placed = std::clamp(share, kept, 1 - kept);
      const double moved = std::abs(placed - p / (p - q)) *
                           length(metric.mm(field.place(outside) - field.place(inside)));
      if (!(moved <= farthest)) farthest = moved;
    }
  });
  return std::ranges::max(most) * (1 + 1e-6);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                          \
  template std::optional<Field> make_field(const Lattice<T>&, const ExtractOptions&, \
                                           std::uint32_t, const Context&);           \
  template double shift_of(const Lattice<T>&, const ExtractOptions&, const Field&,   \
                           std::span<const Crossing>, const Context&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh::collapse
