// One slice of a canonical volume as an 8-bit grey PNG.
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

// Empty for a name that is not "x", "y" or "z".
std::optional<Axis> axis_of(std::string_view name);
std::string_view to_string(Axis axis);

struct SliceChoice {
  Axis axis = Axis::kZ;               // which index is fixed
  std::uint32_t index = 0;            // at which sample; below the volume's size along the axis
  std::array<double, 2> window = {};  // what becomes black and what becomes white
};

// A PNG that is encoded piece by piece, as it is sent, and reads only the samples of its slice. The
// picture's columns run along x (along y for the axis x), its rows along y (along z for the axes x
// and y); the first row and column are sample 0, and nothing is mirrored. Samples at or below
// window[0] are black, those at or above window[1] white, and those between are grey in proportion;
// what is no number is black. The picture tells the size of its pixels (pHYs).
//
// The bytes depend on the volume and the choice alone. Not thread safe.
class SlicePng {
 public:
  // Throws Error kInternal.
  SlicePng(std::shared_ptr<const CanonicalFile> volume, const SliceChoice& choice);
  ~SlicePng();
  SlicePng(const SlicePng&) = delete;
  SlicePng& operator=(const SlicePng&) = delete;

  // The samples that one call of next() looks at, but for the last row.
  static constexpr std::size_t kSamplesPerPiece = std::size_t{1} << 20;

  // The next bytes of the file; nothing at its end. A piece may be empty: what is of one grey
  // makes few bytes of many samples. Throws Error kInternal, and kUnusableVolume when the file has
  // become shorter.
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
  std::vector<std::byte> block_;  // of the file
  std::string bytes_;             // encoded; next() has returned the first taken_ of them
  std::size_t taken_ = 0;
  std::unique_ptr<Writer> writer_;
};

}  // namespace isomesh::volume
