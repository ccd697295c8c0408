// Compiled once for each instruction set, as slabs.cpp.
#include "server/mesh/extract/sample_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/extract/sample_rows.cpp"
#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "proto/samples.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The signs of up to 64 samples; bits beyond `count` are zero.
template <class T>
HWY_INLINE Word classify_word(const T* samples, std::size_t count, T smallest) {
  std::array<std::uint8_t, kWordBits> flags = {};
  if (count == kWordBits) {  // a constant count, which the compiler turns into wide compares
    for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = samples[x] >= smallest ? 1 : 0;
  } else {
    for (std::size_t x = 0; x < count; ++x) flags[x] = samples[x] >= smallest ? 1 : 0;
  }
  return pack_word(flags);
}

template <class T>
class RowsOf final : public SampleRows {
 public:
  RowsOf(const Lattice<T>& lattice, const ExtractOptions& options, T smallest)
      : lattice_(lattice),
        iso_(options.iso),
        smallest_(smallest),
        placement_(options, lattice.dims, lattice.to_space) {
    if (options.close) border_.emplace(lattice, options, smallest, placement_);
  }

  void classify(std::uint32_t y, std::uint32_t z, std::uint64_t* out) const override {
    const T* samples = row(y, z);
    const std::size_t width = lattice_.dims.x;
    for (std::size_t begin = 0; begin < width; begin += kWordBits) {
      const std::size_t count = std::min<std::size_t>(kWordBits, width - begin);
      *out++ = classify_word(samples + begin, count, smallest_);
    }
  }

  void nearness(std::uint32_t y, std::uint32_t z, std::uint32_t begin,
                std::span<std::int32_t> out) const override {
    const T* samples = row(y, z) + begin;
    for (std::size_t x = 0; x < out.size(); ++x) {
      const auto distance = static_cast<float>(std::abs(static_cast<double>(samples[x]) - iso_));
      // Its bits rise with a number that is not negative; they are moved down to where signed
      // numbers begin, since those are what processors compare.
      const std::uint32_t rank =
          std::bit_cast<std::uint32_t>(distance) << 1 | (samples[x] < smallest_ ? 1U : 0U);
      out[x] = std::bit_cast<std::int32_t>(rank ^ std::uint32_t{1} << 31);
    }
  }

  void shares(const RowEdges& edges, double* out) const override {
    const T* samples = row(edges.y, edges.z) - edges.margin;
    const std::uint32_t places = edges.places;
    const auto shift = static_cast<unsigned>(std::countr_zero(places));
    for (const std::uint32_t edge : edges.edges) {
      const std::uint32_t x = edge >> shift;
      const unsigned odd = (x + edges.parity) & 1;
      const auto [from, to] = edges.ends[odd * places + (edge & (places - 1))];
      *out++ = placement_.share(samples[x + from], samples[x + to]);
    }
  }

  BorderVertex place_at_border(const BorderSample& cell, const EdgeEnds& ends) const override {
    return border_->place(cell, ends);
  }

 private:
  const T* row(std::uint32_t y, std::uint32_t z) const {
    return lattice_.samples + (std::size_t{z} * lattice_.dims.y + y) * lattice_.dims.x;
  }

  const Lattice<T>& lattice_;
  const double iso_;
  const T smallest_;
  const Placement placement_;
  std::optional<BorderPlacement<T>> border_;
};

// Highway's tables hold functions, not templates.
#define ISOMESH_FOR_TYPE(T, Name, kType)                                                          \
  std::unique_ptr<const SampleRows> make_rows_##Name(const Lattice<T>& lattice,                   \
                                                     const ExtractOptions& options, T smallest) { \
    return std::make_unique<RowsOf<T>>(lattice, options, smallest);                               \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_FOR_TYPE)
#undef ISOMESH_FOR_TYPE

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

#define ISOMESH_DISPATCH(T, Name, kType)                                                          \
  HWY_EXPORT(make_rows_##Name);                                                                   \
  template <>                                                                                     \
  std::unique_ptr<const SampleRows> make_sample_rows(const Lattice<T>& lattice,                   \
                                                     const ExtractOptions& options, T smallest) { \
    return HWY_DYNAMIC_DISPATCH(make_rows_##Name)(lattice, options, smallest);                    \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_DISPATCH)
#undef ISOMESH_DISPATCH

}  // namespace isomesh::mesh
#endif
