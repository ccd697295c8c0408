// The labels of the samples of planes. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_LABEL_PLANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_LABEL_PLANES_INL_H_
#undef ISOMESH_LABEL_PLANES_INL_H_
#else
#define ISOMESH_LABEL_PLANES_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/labels/label_slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The label numbers of one plane of samples. Each row goes on with its last one, so that the word
// after a row's last sample can be read.
class LabelPlane {
 public:
  static constexpr std::int32_t kMixed = -1;

  explicit LabelPlane(const Dims& dims)
      : dims_(dims),
        words_(words_of(dims.x)),
        stride_(words_ * kWordBits + 1),
        numbers_(stride_ * dims.y),
        wholes_(words_ * dims.y) {}

  const PartNumber* row(std::size_t y) const { return numbers_.data() + y * stride_; }
  // For each word, the label that its samples and the one behind them have, or kMixed.
  const std::int32_t* wholes(std::size_t y) const { return wholes_.data() + y * words_; }

  // `fill` writes the samples of a row.
  template <class Fill>
  void fill_row(std::size_t y, Fill fill) {
    PartNumber* row = numbers_.data() + y * stride_;
    fill(row);
    std::fill(row + dims_.x, row + stride_, row[dims_.x - 1]);
    for (std::size_t w = 0; w < words_; ++w) {
      const PartNumber* word = row + w * kWordBits;
      PartNumber change = 0;
      for (std::size_t x = 0; x < kWordBits; ++x) {
        change = static_cast<PartNumber>(change | (word[x] ^ word[x + 1]));
      }
      wholes_[y * words_ + w] = change == 0 ? std::int32_t{word[0]} : kMixed;
    }
  }

 private:
  Dims dims_;
  std::size_t words_;
  std::size_t stride_;
  std::vector<PartNumber> numbers_;
  std::vector<std::int32_t> wholes_;
};

// Fills `plane` with the labels of plane z, phantoms included.
inline void classify(const Separation& separation, std::uint32_t z, LabelPlane& plane) {
  const Dims& inner = separation.samples->dims();
  const std::uint32_t margin = separation.margin;
  const auto is_outside = [&](std::uint32_t at, std::uint32_t samples) {
    return at < margin || at >= samples + margin;
  };
  for (std::uint32_t y = 0; y < separation.dims.y; ++y) {
    plane.fill_row(y, [&](PartNumber* row) {
      std::fill_n(row, separation.dims.x, PartNumber{0});
      if (is_outside(y, inner.y) || is_outside(z, inner.z)) return;
      separation.samples->copy_row(y - margin, z - margin, row + margin);
    });
  }
}

// The samples of a word of which `compare` holds for their labels in `a` and in `b`.
template <class Compare>
HWY_INLINE Word compared(const PartNumber* a, const PartNumber* b, Compare compare) {
  std::array<std::uint8_t, kWordBits> flags;
  for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = compare(a[x], b[x]) ? 1 : 0;
  return pack_word(flags);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
