// Compiled once for each instruction set, as slabs.cpp.
#include "server/mesh/extract/sample_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/extract/sample_rows.cpp"
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "proto/samples.h"
#include "server/mesh/extract/nearness.h"
#include "server/mesh/lattice/bcc_faces.h"
#include "server/mesh/lattice/cell_mean.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The signs of up to 64 samples; bits beyond `count` are zero.
template <class T, class IsInside>
HWY_INLINE Word classify_word(const T* samples, std::size_t count, IsInside is_inside) {
  std::array<std::uint8_t, kWordBits> flags = {};
  if (count == kWordBits) {  // a constant count, which the compiler turns into wide compares
    for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = is_inside(samples[x]) ? 1 : 0;
  } else {
    for (std::size_t x = 0; x < count; ++x) flags[x] = is_inside(samples[x]) ? 1 : 0;
  }
  return pack_word(flags);
}

template <class T>
class RowsOf final : public SampleRows {
 public:
  RowsOf(const Lattice<T>& lattice, const ExtractOptions& options, const Threshold<T>& threshold)
      : lattice_(lattice),
        options_(options),
        threshold_(threshold),
        nearness_(options.iso, options.scheme == Scheme::kBcc,
                  power_for(lattice.samples, lattice.dims.samples(), options.iso)),
        placement_(options, lattice.dims, lattice.to_space),
        // An edge from a centre to a corner takes half a step along each axis.
        half_edges_(options, std::min(2 * placement_.nearest(), kMostNearest)) {
    if (options.close) border_.emplace(lattice, options, threshold, placement_);
  }

  void classify(std::uint32_t y, std::uint32_t z, std::uint64_t* out) const override {
    const T limit = threshold_.limit;
    if (threshold_.inside == Inside::kAbove) {
      classify_row(row(y, z), out, [limit](T sample) { return sample >= limit; });
    } else {
      classify_row(row(y, z), out, [limit](T sample) { return sample <= limit; });
    }
  }

  void nearness(std::uint32_t y, std::uint32_t z, std::uint32_t begin, std::size_t count,
                std::byte* out) const override {
    const T* samples = row(y, z) + begin;
    write_ranks(out, count, [=, nearness = nearness_](std::size_t x, auto rank) {
      using Rank = decltype(rank);
      if constexpr (sizeof(Rank) == sizeof(std::int32_t)) {
        return nearness.of_value(static_cast<double>(samples[x]));
      } else {
        return nearness.template of_sample<Rank>(samples[x]);
      }
    });
  }

  void centre_nearness(std::uint32_t y, std::uint32_t z, std::uint32_t begin, std::size_t count,
                       std::byte* out) const override {
    const T* samples = row(y, z) + begin;
    // clang++ 14 lets no lambda capture a structured binding.
    const std::array<std::ptrdiff_t, 2> next = steps();
    write_ranks(out, count, [=, this](std::size_t x, auto rank) {
      using Rank = decltype(rank);
      if constexpr (sizeof(Rank) == sizeof(std::int32_t)) {
        return nearness_.of_value(mean_of_cell(samples + x, next[0], next[1]));
      } else {
        return nearness_.template of_sum<Rank>(sum_of_cell(samples + x, next[0], next[1]));
      }
    });
  }

  std::size_t rank_bytes() const override { return nearness_.bytes(); }

  void shares(const RowEdges& edges, double* out) const override {
    const T* samples = row(edges.y, edges.z) - edges.margin;
    const std::uint32_t places = edges.places;
    const auto shift = static_cast<unsigned>(std::countr_zero(places));
    write_shares(edges.edges, out, [&](std::uint32_t edge) {
      const std::uint32_t x = edge >> shift;
      const unsigned odd = (x + edges.parity) & 1;
      const auto [from, to] = edges.ends[odd * places + (edge & (places - 1))];
      return EdgeValues{static_cast<double>(samples[x + from]),
                        static_cast<double>(samples[x + to]), &placement_};
    });
  }

  void add_centres(std::uint32_t y, std::uint32_t z, std::uint32_t margin,
                   std::span<const std::uint64_t> uncertain, std::uint64_t* out) const override {
    const T* samples = row(y, z) - margin;
    const auto [next_row, next_plane] = steps();
    for (std::size_t w = 0; w < uncertain.size(); ++w) {
      const T* begin = samples + w * kWordBits;
      Word inside = 0;
      for (Word rest = uncertain[w]; rest != 0; rest &= rest - 1) {
        const int bit = std::countr_zero(rest);
        inside |= Word{options_.contains(mean_of_cell(begin + bit, next_row, next_plane))} << bit;
      }
      out[w] |= inside;
    }
  }

  void bcc_shares(const BccRowEdges& edges, double* out) const override {
    const T* samples = row(edges.y, edges.z) - edges.margin;
    const std::array<std::ptrdiff_t, 2> next = steps();  // as in centre_nearness
    const T* known = nullptr;                            // the cell whose mean is `centre`
    double centre = 0;
    write_shares(edges.edges, out, [&](std::uint32_t edge) {
      const BccEdgeSamples& ends = edges.ends[edge % kBccPlaces];
      const T* from = samples + edge / kBccPlaces + ends.from;
      const T* to = samples + edge / kBccPlaces + ends.to;
      if (ends.is_from_centre && std::exchange(known, from) != from) {
        centre = mean_of_cell(from, next[0], next[1]);
      }
      return EdgeValues{
          ends.is_from_centre ? centre : static_cast<double>(*from),
          ends.is_to_centre ? mean_of_cell(to, next[0], next[1]) : static_cast<double>(*to),
          ends.is_from_centre == ends.is_to_centre ? &placement_ : &half_edges_};
    });
  }

  BorderVertex place_at_border(const BorderSample& cell, const EdgeEnds& ends) const override {
    return border_->place(cell, ends);
  }

 private:
  static constexpr double kMostNearest = 0.25;

  template <class IsInside>
  HWY_INLINE void classify_row(const T* samples, Word* out, IsInside is_inside) const {
    const std::size_t width = lattice_.dims.x;
    for (std::size_t begin = 0; begin < width; begin += kWordBits) {
      const std::size_t count = std::min<std::size_t>(kWordBits, width - begin);
      *out++ = classify_word(samples + begin, count, is_inside);
    }
  }

  struct EdgeValues {
    double from;
    double to;
    const Placement* placement;
  };

  // Shares of edges with the values that values_of(edge) has. Values are gathered first, so that
  // the compiler can divide several at once.
  template <class ValuesOf>
  HWY_INLINE void write_shares(std::span<const std::uint32_t> edges, double* out,
                               ValuesOf values_of) const {
    constexpr std::size_t kBlock = 64;
    std::array<double, kBlock> from;
    std::array<double, kBlock> to;
    std::array<double, kBlock> nearest;
    if (placement_.is_midpoint()) {
      std::fill_n(out, edges.size(), 0.5);
      return;
    }
    for (std::size_t begin = 0; begin < edges.size(); begin += kBlock) {
      const std::size_t count = std::min(kBlock, edges.size() - begin);
      for (std::size_t i = 0; i < count; ++i) {
        const EdgeValues values = values_of(edges[begin + i]);
        from[i] = values.from;
        to[i] = values.to;
        nearest[i] = values.placement->nearest();
      }
      for (std::size_t i = 0; i < count; ++i) {
        out[begin + i] = Placement::share<T>(options_.iso, from[i], to[i], nearest[i]);
      }
    }
  }

  // rank_at(x, a Rank) for each of the samples.
  template <class RankAt>
  HWY_INLINE void write_ranks(std::byte* out, std::size_t count, RankAt rank_at) const {
    const auto write = [&](auto* ranks) {
      for (std::size_t x = 0; x < count; ++x) ranks[x] = rank_at(x, *ranks);
    };
    if (nearness_.bytes() == sizeof(std::int32_t)) {
      return write(reinterpret_cast<std::int32_t*>(out));
    }
    if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
      if (nearness_.bytes() == sizeof(std::int8_t)) {
        return write(reinterpret_cast<std::int8_t*>(out));
      }
      write(reinterpret_cast<std::int16_t*>(out));
    }
  }

  // From a sample to the next ones along y and z.
  std::array<std::ptrdiff_t, 2> steps() const {
    return {sample_offset(lattice_.dims, 2), sample_offset(lattice_.dims, 4)};
  }

  const T* row(std::uint32_t y, std::uint32_t z) const {
    return lattice_.samples + (std::size_t{z} * lattice_.dims.y + y) * lattice_.dims.x;
  }

  const Lattice<T>& lattice_;
  const ExtractOptions options_;
  const Threshold<T> threshold_;
  const Nearness<T> nearness_;
  const Placement placement_;
  const Placement half_edges_;  // of the body-centred lattice
  std::optional<BorderPlacement<T>> border_;
};

// Highway's tables hold functions, not templates.
#define ISOMESH_FOR_TYPE(T, Name, kType)                                                         \
  std::unique_ptr<const SampleRows> make_rows_##Name(                                            \
      const Lattice<T>& lattice, const ExtractOptions& options, const Threshold<T>& threshold) { \
    return std::make_unique<RowsOf<T>>(lattice, options, threshold);                             \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_FOR_TYPE)
#undef ISOMESH_FOR_TYPE

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

#define ISOMESH_DISPATCH(T, Name, kType)                                                         \
  HWY_EXPORT(make_rows_##Name);                                                                  \
  template <>                                                                                    \
  std::unique_ptr<const SampleRows> make_sample_rows(                                            \
      const Lattice<T>& lattice, const ExtractOptions& options, const Threshold<T>& threshold) { \
    return HWY_DYNAMIC_DISPATCH(make_rows_##Name)(lattice, options, threshold);                  \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_DISPATCH)
#undef ISOMESH_DISPATCH

}  // namespace isomesh::mesh
#endif
