// A slice of a canonical volume: its samples, or an 8-bit grey PNG.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
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

// Reads the samples of a slice row by row, and no others. Columns run along x (along y for the axis
// x), rows along y (along z for the axes x and y), both from sample 0, without mirroring. Not
// thread safe.
class SliceSamples {
 public:
  SliceSamples(std::shared_ptr<const CanonicalFile> volume, Axis axis, std::uint32_t index);

  const CanonicalHeader& header() const { return volume_->header(); }
  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  std::array<double, 2> spacing() const;  // millimetres between columns and between rows
  std::uint64_t row_bytes() const { return width_ * bytes_per_sample(header().type); }

  // Returns the samples of that row, little-endian; valid until the next call. Throws Error
  // kInternal, and kUnusableVolume if the file was truncated.
  std::span<const std::byte> row(std::uint32_t row);

  // Returns the next rows in one piece; empty after the last row. Throws as row() does.
  std::optional<std::string> next();

 private:
  std::shared_ptr<const CanonicalFile> volume_;
  Axis axis_;
  std::uint32_t index_;
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
  std::uint32_t next_row_ = 0;  // of next()
  std::vector<std::byte> row_;
  std::vector<std::byte> block_;
};

// A PNG encoded in pieces while it is sent, with the rows and columns of SliceSamples. Samples up
// to window[0] and NaN are black, from window[1] on white, linear between them. The picture has its
// pixels' size (pHYs).
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

  SliceSamples samples_;
  std::array<double, 2> window_;
  std::uint32_t next_row_ = 0;
  std::vector<std::uint8_t> row_;
  std::string bytes_;  // encoded; next() returned the first taken_ of them
  std::size_t taken_ = 0;
  std::unique_ptr<Writer> writer_;
};

}  // namespace isomesh::volume
