// A slice of a canonical volume as an 8-bit grey PNG.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/volume/canonical.h"

namespace isomesh::volume {

enum class Axis { kX, kY, kZ };

// Empty unless the name is "x", "y" or "z".
std::optional<Axis> axis_of(std::string_view name);
std::string_view to_string(Axis axis);

struct SliceChoice {
  Axis axis = Axis::kZ;               // the fixed index
  std::uint32_t index = 0;            // less than the volume's size along the axis
  std::array<double, 2> window = {};  // mapped to black and to white
};

// A PNG encoded in pieces while it is sent; reads only the samples of its slice. Columns run along
// x (along y for the axis x), rows along y (along z for the axes x and y), both from sample 0,
// without mirroring. Samples up to window[0] and NaN are black, from window[1] on white, linear
// between them. The picture has its pixels' size (pHYs).
//
// The bytes depend only on the volume and the choice. Not thread safe.
class SlicePng {
 public:
  // Throws Error kInternal.
  SlicePng(std::shared_ptr<const CanonicalFile> volume, const SliceChoice& choice);
  ~SlicePng();
  SlicePng(const SlicePng&) = delete;
  SlicePng& operator=(const SlicePng&) = delete;

  // Limit of samples processed per call of next(), rounded up to a whole row.
  static constexpr std::size_t kSamplesPerPiece = std::size_t{1} << 20;

  // Returns the next bytes of the file, possibly none, because uniform areas compress well; empty
  // at its end. Throws Error kInternal, and kUnusableVolume if the file was truncated.
  std::optional<std::string_view> next();

 private:
  struct Writer;

  void write_row();
  void read_row(std::uint32_t row);
  template <class Sample>
  void read_row_as(std::uint64_t first, std::uint64_t step);

  std::shared_ptr<const CanonicalFile> volume_;
  SliceChoice choice_;
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
  std::uint32_t next_row_ = 0;
  std::vector<std::uint8_t> row_;
  std::vector<std::byte> block_;
  std::string bytes_;  // encoded; next() returned the first taken_ of them
  std::size_t taken_ = 0;
  std::unique_ptr<Writer> writer_;
};

}  // namespace isomesh::volume
