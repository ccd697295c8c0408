#include "server/mesh/collapse/field.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "proto/samples.h"
#include "server/mesh/lattice/bcc_faces.h"
#include "server/mesh/lattice/border.h"
#include "server/mesh/lattice/cell_mean.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr double kLargest = 256;
constexpr float kLeast = 1e-6F;
constexpr double kMostNearest = 0.25;  // as of SampleRows

template <class T>
double largest_difference(const Lattice<T>& lattice, double iso) {
  const auto [low, high] =
      std::minmax_element(lattice.samples, lattice.samples + lattice.dims.samples());
  return std::max(std::abs(static_cast<double>(*low) - iso),
                  std::abs(static_cast<double>(*high) - iso));
}

// The points at the ends of a sample's edges, by direction or slot, as offsets from the sample.
using EdgeOffsets = std::array<std::array<std::ptrdiff_t, 2>, kBccSlots>;

// For a sample of odd i+j+k or not. Its edges lie in the cell whose corner 0 it is.
EdgeOffsets edges_of(const Field& field, bool is_odd) {
  EdgeOffsets edges = {};
  const CellSplit& split = cell_split(field.scheme, is_odd);
  for (unsigned d = 1; d < 8; ++d) {
    edges[d] = {sample_offset(field.dims, split.ends[d].from),
                sample_offset(field.dims, split.ends[d].to)};
  }
  return edges;
}

// For a sample whose cell has a centre, or has none.
EdgeOffsets bcc_edges_of(const Field& field, bool has_centre) {
  EdgeOffsets edges = {};
  for (const unsigned direction : {1U, 2U, 4U, 3U, 5U, 6U, 7U}) {
    edges[bcc_slot_of(direction)] = {0, sample_offset(field.dims, direction)};
  }
  const std::ptrdiff_t centre = field.first_centre;
  for (unsigned c = 0; c < 8 && has_centre; ++c) edges[c] = {centre, sample_offset(field.dims, c)};
  for (unsigned axis = 0; axis < 3; ++axis) {
    edges[kBccCentreSlot + axis] = {centre, centre + sample_offset(field.dims, 1U << axis)};
  }
  return edges;
}

// The crossed slots of a sample. `inside`: the corners of its cell; `steps`: a bit for each axis
// along which there is a next sample.
unsigned crossed_slots(const Field& field, std::size_t sample, unsigned inside, unsigned steps) {
  const float* const centre = &field.values[field.first_centre + sample];
  const bool is_inside = *centre > 0;
  const auto is_crossed = [&](unsigned direction) {
    return (steps & direction) == direction && ((inside ^ inside >> direction) & 1) != 0;
  };
  unsigned set = 0;
  if (*centre != kNoCentre) {
    set = inside ^ (is_inside ? 0xFFU : 0U);
  } else if (is_crossed(7)) {
    set = 1;
  }
  for (unsigned axis = 0; axis < 3; ++axis) {
    const auto mark = [&](unsigned first_slot, bool is_set) {
      if (is_set) set |= 1U << (first_slot + axis);
    };
    const std::ptrdiff_t step = sample_offset(field.dims, 1U << axis);
    const bool is_between = *centre != kNoCentre && centre[-step] != kNoCentre;
    mark(kBccAxisSlot, is_crossed(1U << axis));
    mark(kBccCentreSlot,
         *centre != kNoCentre && centre[step] != kNoCentre && (centre[step] > 0) != is_inside);
    mark(kBccDiagonalSlot, !is_between && is_crossed(7U ^ 1U << axis));
  }
  return set;
}

// Calls visit(sample, its crossed edges as bits by direction or slot, all its edges) for those of a
// layer that own any.
template <class Visit>
void visit_crossed(const Field& field, std::uint32_t z, Visit visit) {
  const Dims& dims = field.dims;
  const bool is_bcc = field.scheme == Scheme::kBcc;
  const std::array edges = {is_bcc ? bcc_edges_of(field, false) : edges_of(field, false),
                            is_bcc ? bcc_edges_of(field, true) : edges_of(field, true)};
  const std::array splits = {&cell_split(field.scheme, false), &cell_split(field.scheme, true)};
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
      const unsigned all_steps = steps | (x + 1 < dims.x ? 1U : 0U);
      if (is_bcc) {
        const unsigned set = crossed_slots(field, sample, signs, all_steps);
        const bool has_centre = field.values[field.first_centre + sample] != kNoCentre;
        if (set != 0) visit(sample, set, edges[has_centre ? 1 : 0]);
        continue;
      }
      if (signs == 0 || signs == 0xFF) continue;
      const unsigned odd = (x + y + z) & 1;
      unsigned set = 0;
      for (unsigned left = splits[odd]->crossed[signs]; left != 0; left &= left - 1) {
        const auto d = static_cast<unsigned>(std::countr_zero(left));
        if ((d & ~all_steps) == 0) set |= 1U << d;
      }
      if (set != 0) visit(sample, set, edges[odd]);
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
  const auto value_of = [&](double sample) {
    const double difference = sample - options.iso;
    const auto scaled = static_cast<float>(std::scalbn(std::abs(difference), exponent));
    const float value = is_sign ? 1 : std::max(scaled, kLeast);
    return options.contains(sample) ? value : -value;
  };
  const std::size_t layer = std::size_t{dims.x} * dims.y;
  field->values.assign(dims.samples() + layer + dims.x + 2, margin == 0 ? 0 : kPhantom);
  const bool has_centres = options.scheme == Scheme::kBcc;
  if (has_centres) {
    // The layers before and behind have none.
    const std::size_t first = field->values.size() + layer;
    if (first + dims.samples() > std::numeric_limits<std::uint32_t>::max()) return {};
    field->first_centre = static_cast<std::uint32_t>(first);
    field->values.resize(first + dims.samples() + layer, kNoCentre);
  }
  parallel_for(context, inner.z, [&](std::size_t z) {
    const T* from = lattice.samples + z * inner.x * inner.y;
    for (std::size_t y = 0; y < inner.y; ++y, from += inner.x) {
      const std::size_t row = ((z + margin) * dims.y + y + margin) * dims.x + margin;
      const auto at = [&](std::size_t point) {
        return field->values.begin() + static_cast<std::ptrdiff_t>(point);
      };
      std::transform(from, from + inner.x, at(row), value_of);
      if (!has_centres || y + 1 == inner.y || z + 1 == inner.z) continue;
      for (std::size_t x = 0; x + 1 < inner.x; ++x) {
        *at(field->first_centre + row + x) =
            value_of(mean_of_cell(from + x, sample_offset(inner, 2), sample_offset(inner, 4)));
      }
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
                  [&](std::size_t, unsigned set, const EdgeOffsets&) {
                    count += static_cast<std::size_t>(std::popcount(set));
                  });
    begin[z + 1] = count;
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  crossings.all.resize(begin.back());
  parallel_for(context, field.dims.z, [&](std::size_t z) {
    Crossing* out = crossings.all.data() + begin[z];
    visit_crossed(
        field, static_cast<std::uint32_t>(z),
        [&](std::size_t sample, unsigned set, const EdgeOffsets& edges) {
          for (; set != 0; set &= set - 1) {
            const auto point = [&](std::ptrdiff_t offset) {
              return static_cast<std::uint32_t>(static_cast<std::ptrdiff_t>(sample) + offset);
            };
            const auto& [a, b] = edges[static_cast<unsigned>(std::countr_zero(set))];
            const bool is_inside = field.values[point(a)] > 0;
            *out++ = is_inside ? Crossing{point(a), point(b)} : Crossing{point(b), point(a)};
          }
        });
  });
  return crossings;
}

std::vector<std::uint8_t> leave_out(std::span<const std::uint64_t> kept, const Context& context,
                                    Field& field, Crossings& crossings) {
  const Dims dims = field.dims;
  const std::size_t plane = std::size_t{dims.x} * dims.y;
  // A point is turned if a way from the first sample crosses what is left out an odd number of
  // times: any way, here along z, then y, then x, and from a cell's corner 0 to its centre.
  using Flags = std::vector<bool>;
  std::vector<Flags> is_turned(dims.z, Flags(plane, false));
  std::vector<Flags> centre_turns(field.scheme == Scheme::kBcc ? dims.z : 0, Flags(plane, false));
  std::vector<std::uint8_t> next_turns(dims.z, 0);  // between planes
  parallel_for(context, dims.z, [&](std::size_t z) {
    Flags& turned = is_turned[z];
    std::size_t number = crossings.layer_begin[z];
    visit_crossed(field, static_cast<std::uint32_t>(z),
                  [&](std::size_t sample, unsigned set, const EdgeOffsets& edges) {
                    const std::size_t at = sample - z * plane;
                    for (; set != 0; set &= set - 1, ++number) {
                      if ((kept[number / kFlagBits] >> (number % kFlagBits) & 1) != 0) continue;
                      const auto [a, b] = edges[static_cast<unsigned>(std::countr_zero(set))];
                      if (std::min(a, b) != 0) continue;  // of no such way
                      const auto way = static_cast<std::size_t>(std::max(a, b));
                      if (way == 1) turned[at + 1] = true;
                      if (way == dims.x && at % dims.x == 0) turned[at + dims.x] = true;
                      if (way == plane && at == 0) next_turns[z] = 1;
                      if (way == field.first_centre) centre_turns[z][at] = true;
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
  const auto is_centre_turned = [&](std::size_t z, std::size_t at) {
    return is_turned[z][at] != centre_turns[z][at];
  };
  parallel_for(context, dims.z, [&](std::size_t z) {
    float* const values = field.values.data() + z * plane;
    for (std::size_t at = 0; at < plane; ++at) {
      if (is_turned[z][at]) values[at] = -values[at];
      if (centre_turns.empty() || !is_centre_turned(z, at)) continue;
      values[field.first_centre + at] = -values[field.first_centre + at];
    }
  });
  crossings = crossings_of(field, context);
  std::vector<std::uint8_t> flags(crossings.all.size(), 0);
  for_each(context, flags.size(), [&](std::size_t v) {
    const std::uint32_t inside = crossings.all[v].inside;
    const bool is_centre = field.is_centre(inside);
    const std::uint32_t sample = is_centre ? inside - field.first_centre : inside;
    const std::size_t z = sample / plane;
    const std::size_t at = sample % plane;
    flags[v] = (is_centre ? is_centre_turned(z, at) : is_turned[z][at]) ? 1 : 0;
  });
  if (std::ranges::find(flags, 1) == flags.end()) flags.clear();
  return flags;
}

PlaneCrossings::PlaneCrossings(const Field& field, const Crossings& crossings, std::uint32_t z)
    : begin_(std::size_t{z} * field.dims.x * field.dims.y),
      samples_(std::size_t{field.dims.x} * field.dims.y) {
  auto next = static_cast<std::uint32_t>(crossings.layer_begin[z]);
  visit_crossed(field, z, [&](std::size_t sample, unsigned set, const EdgeOffsets&) {
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
  const auto difference = [&](std::uint32_t point) {
    const bool is_centre = field.is_centre(point);
    const Vecd at =
        field.place(is_centre ? point - field.first_centre : point) - Vecd{1, 1, 1} * field.margin;
    const Dims& inner = lattice.dims;
    const T* sample =
        lattice.samples + static_cast<std::size_t>(at.x + inner.x * (at.y + inner.y * at.z));
    const double value =
        is_centre ? mean_of_cell(sample, sample_offset(inner, 2), sample_offset(inner, 4))
                  : static_cast<double>(*sample);
    return value - options.iso;
  };
  // Vertices keep away from samples.
  const double nearest = Placement::nearest_share(lattice.dims, lattice.to_space);
  const double kept = field.margin == 0 ? nearest : nearest_on_border(nearest);
  // An edge from a centre to a sample is shorter.
  const double kept_of_half = std::max(kept, std::min(2 * nearest, kMostNearest));
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
      const bool is_half = field.is_centre(inside) != field.is_centre(outside);
      const double off_ends = is_half ? kept_of_half : kept;
      const double placed = std::clamp(share, off_ends, 1 - off_ends);
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
