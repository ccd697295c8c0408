#include "server/hospital/orders/label_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <string_view>

#include "proto/error.h"
#include "proto/samples.h"
#include "server/volume/canonical.h"
#include "server/volume/geometry.h"
#include "server/volume/labels.h"

namespace isomesh::orders {
namespace {

using Place = std::array<double, 3>;

[[noreturn]] void throw_unfit(const std::string& why) {
  throw Error(ErrorCode::kUnusableVolume, "the label volume does not fit the series: " + why);
}

double distance(const Place& a, const Place& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

Place place_of(const Geometry& geometry, const std::array<double, 3>& index) {
  Place place = geometry.origin;
  for (int axis = 0; axis < 3; ++axis) {
    const Place step = volume::step_of(geometry, axis);
    for (std::size_t i = 0; i < 3; ++i) {
      place[i] += index[static_cast<std::size_t>(axis)] * step[i];
    }
  }
  return place;
}

// The slices that are read at once. Those across the layers of the file have samples all over it,
// so a window of them is.
std::uint32_t window_slices(const LabelGrid& grid) {
  if (grid.axes[2] == 2) return 1;
  const std::size_t slice = bytes_per_sample(grid.type) * grid.dims[0] * grid.dims[1];
  return static_cast<std::uint32_t>(
      std::clamp<std::size_t>(grid.window_bytes / slice, 1, grid.dims[2]));
}

template <class Sample>
std::int64_t label_of(Sample value) {
  if constexpr (std::is_floating_point_v<Sample>) {
    return volume::is_nearly_whole(value) ? volume::whole_number(value) : 0;
  } else {
    return static_cast<std::int64_t>(value);
  }
}

void read(const store::BlobReader& samples, std::uint64_t offset, std::span<std::byte> target) {
  if (samples.read_at(volume::kHeaderBytes + offset, target) != target.size()) {
    throw Error(ErrorCode::kInternal, "a stored label volume became shorter");
  }
}

// Reads slices of the label volume as the images have them.
class SliceReader {
 public:
  SliceReader(const LabelGrid& grid, const store::BlobStore& blobs)
      : grid_(grid),
        samples_(blobs.open(grid.samples)),
        sample_bytes_(bytes_per_sample(grid.type)),
        slice_bytes_(sample_bytes_ * grid.dims[0] * grid.dims[1]),
        labels_(std::size_t{grid.dims[0]} * grid.dims[1]) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      stored_dims_[grid.axes[axis]] = grid.dims[axis];
      image_axes_[grid.axes[axis]] = axis;
    }
  }

  std::span<const std::int64_t> read(std::uint32_t slice) {
    if (current_ == slice) return labels_;
    if (slice < begin_ || slice >= end_) read_window(slice);
    with_sample(grid_.type, [&](auto sample) {
      decode<decltype(sample)>(window_.data() + (slice - begin_) * slice_bytes_);
    });
    current_ = slice;
    return labels_;
  }

 private:
  // Along an axis of the file.
  struct Range {
    std::uint32_t begin;
    std::uint32_t end;
  };

  void read_window(std::uint32_t slice) {
    const std::uint32_t count = window_slices(grid_);
    begin_ = slice / count * count;
    end_ = begin_ + std::min(count, grid_.dims[2] - begin_);
    window_.resize((end_ - begin_) * slice_bytes_);
    std::array<Range, 3> ranges = {Range{0, stored_dims_[0]}, Range{0, stored_dims_[1]},
                                   Range{0, stored_dims_[2]}};
    ranges.at(grid_.axes[2]) = grid_.is_flipped[2]
                                   ? Range{grid_.dims[2] - end_, grid_.dims[2] - begin_}
                                   : Range{begin_, end_};
    for (std::uint32_t z = ranges[2].begin; z < ranges[2].end; ++z) read_rows(ranges, z);
  }

  void read_rows(const std::array<Range, 3>& ranges, std::uint32_t z) {
    const std::size_t row_bytes = sample_bytes_ * stored_dims_[0];
    rows_.resize(row_bytes * (ranges[1].end - ranges[1].begin));
    const std::uint64_t first = std::uint64_t{z} * stored_dims_[1] + ranges[1].begin;
    isomesh::orders::read(*samples_, first * row_bytes, rows_);
    with_sample(grid_.type, [&](auto sample) { put_rows<decltype(sample)>(ranges, z); });
  }

  template <class Sample>
  void put_rows(const std::array<Range, 3>& ranges, std::uint32_t z) {
    const std::byte* row = rows_.data();
    for (std::uint32_t y = ranges[1].begin; y < ranges[1].end; ++y) {
      const std::size_t rest = place_along(1, y) + place_along(2, z);
      for (std::uint32_t x = ranges[0].begin; x < ranges[0].end; ++x) {
        std::memcpy(window_.data() + sizeof(Sample) * (place_along(0, x) + rest),
                    row + sizeof(Sample) * x, sizeof(Sample));
      }
      row += sizeof(Sample) * stored_dims_[0];
    }
  }

  // An index along an axis of the file adds this much to a sample's place in the window.
  std::size_t place_along(std::size_t stored_axis, std::uint32_t index) const {
    const std::size_t axis = image_axes_.at(stored_axis);
    const std::size_t there = grid_.is_flipped.at(axis) ? grid_.dims.at(axis) - 1 - index : index;
    if (axis == 0) return there;
    return (axis == 1 ? there : (there - begin_) * grid_.dims[1]) * grid_.dims[0];
  }

  template <class Sample>
  void decode(const std::byte* samples) {
    for (std::size_t n = 0; n < labels_.size(); ++n) {
      Sample value;
      std::memcpy(&value, samples + n * sizeof(Sample), sizeof(Sample));
      labels_[n] = label_of(value);
    }
  }

  const LabelGrid& grid_;
  const std::unique_ptr<const store::BlobReader> samples_;
  const std::size_t sample_bytes_;
  const std::size_t slice_bytes_;
  std::array<std::uint32_t, 3> stored_dims_ = {};  // along the axes of the file
  std::array<std::size_t, 3> image_axes_ = {};     // for each of those, the images' axis
  std::vector<std::byte> rows_;
  std::vector<std::byte> window_;  // the slices [begin_, end_), as the images have them
  std::uint32_t begin_ = 0;
  std::uint32_t end_ = 0;
  std::vector<std::int64_t> labels_;
  std::optional<std::uint32_t> current_;
};

// The slices that have samples of each label.
class Occurrences {
 public:
  Occurrences(std::span<const std::int64_t> labels, std::uint32_t slices)
      : count_(slices), slices_(labels.size()) {
    for (std::size_t place = 0; place < labels.size(); ++place) places_[labels[place]] = place;
  }

  // Throws Error kTooLarge for more than an object may have.
  void add(std::int64_t label, std::uint32_t slice) {
    if (label != last_) {
      last_ = label;
      const auto found = places_.find(label);
      known_ = found == places_.end() ? nullptr : &slices_[found->second];
      if (known_ != nullptr && known_->empty()) known_->resize(count_);
    }
    if (known_ == nullptr || (*known_)[slice]) return;
    (*known_)[slice] = true;
    dicom::check_frames(++frames_);
  }

  // By label, then by slice.
  std::vector<dicom::SegmentationFrame> frames() const {
    std::vector<dicom::SegmentationFrame> frames;
    frames.reserve(frames_);
    for (std::size_t place = 0; place < slices_.size(); ++place) {
      for (std::uint32_t slice = 0; slice < slices_[place].size(); ++slice) {
        if (!slices_[place][slice]) continue;
        frames.push_back({.segment = static_cast<std::uint16_t>(place + 1), .slice = slice});
      }
    }
    return frames;
  }

 private:
  std::uint32_t count_;
  std::map<std::int64_t, std::size_t> places_;
  std::vector<std::vector<bool>> slices_;  // of each label; empty until it is found
  std::size_t frames_ = 0;
  std::optional<std::int64_t> last_;
  std::vector<bool>* known_ = nullptr;  // the slices of the last label; null if it is not wanted
};

// The axis of the label volume that lies most along each axis of the images.
std::array<std::size_t, 3> axes_along(const Geometry& images, const Geometry& labels) {
  std::array<std::size_t, 3> axes = {0, 1, 2};
  std::array<std::size_t, 3> best = axes;
  double best_fit = -1;
  do {
    double fit = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double cosine = 0;
      for (std::size_t row = 0; row < 9; row += 3) {
        cosine += images.direction[row + axis] * labels.direction[row + axes[axis]];
      }
      fit += std::abs(cosine);
    }
    if (fit > best_fit + 1e-9) {
      best_fit = fit;
      best = axes;
    }
  } while (std::ranges::next_permutation(axes).found);
  return best;
}

void check(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
}

void find_in_slices(const LabelGrid& grid, const store::BlobStore& blobs,
                    const std::stop_token& stop, Occurrences& found) {
  SliceReader reader(grid, blobs);
  for (std::uint32_t slice = 0; slice < grid.dims[2]; ++slice) {
    check(stop);
    for (const std::int64_t label : reader.read(slice)) found.add(label, slice);
  }
}

// Each row of the file has a sample of each slice. So the file is read once, and not once for each
// window of slices.
void find_across_rows(const LabelGrid& grid, const store::BlobStore& blobs,
                      const std::stop_token& stop, Occurrences& found) {
  constexpr std::size_t kPieceBytes = std::size_t{1} << 20;
  const auto samples = blobs.open(grid.samples);
  const std::uint32_t slices = grid.dims[2];
  const std::size_t row_bytes = bytes_per_sample(grid.type) * slices;
  const std::uint64_t end = std::uint64_t{row_bytes} * grid.dims[0] * grid.dims[1];
  std::vector<std::byte> piece(std::max<std::size_t>(kPieceBytes / row_bytes, 1) * row_bytes);
  for (std::uint64_t begin = 0; begin < end; begin += piece.size()) {
    check(stop);
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), end - begin)));
    read(*samples, begin, piece);
    with_sample(grid.type, [&](auto sample) {
      std::uint32_t slice = 0;
      for (std::size_t at = 0; at < piece.size(); at += sizeof(sample)) {
        std::memcpy(&sample, piece.data() + at, sizeof(sample));
        found.add(label_of(sample), grid.is_flipped[2] ? slices - 1 - slice : slice);
        if (++slice == slices) slice = 0;
      }
    });
  }
}

}  // namespace

ImageLattice images_of(const Volume& series) {
  // Volumes of older versions have the order of their files.
  if (!series.stored_axes) return {series.dims, series.geometry};
  volume::AxisOrder order = {};
  std::ranges::transform(*series.stored_axes, order.begin(), [](char letter) {
    constexpr std::string_view kAlong = "LPS";
    constexpr std::string_view kAgainst = "RAI";
    const std::size_t along = kAlong.find(letter);
    return along < kAlong.size() ? static_cast<int>(along) + 1
                                 : -static_cast<int>(kAgainst.find(letter)) - 1;
  });
  return {volume::in_order(series.dims, order),
          volume::in_order(series.dims, series.geometry, order)};
}

std::array<std::uint32_t, 3> dims_along(const Geometry& images, const Volume& labels) {
  const auto axes = axes_along(images, labels.geometry);
  return {labels.dims.at(axes[0]), labels.dims.at(axes[1]), labels.dims.at(axes[2])};
}

LabelGrid label_grid(const Geometry& images, const std::array<std::uint32_t, 3>& dims,
                     const Volume& labels) {
  LabelGrid grid = {.dims = dims,
                    .type = labels.type,
                    .samples = labels.samples,
                    .axes = axes_along(images, labels.geometry),
                    .origin = images.origin};
  if (dims_along(images, labels) != dims) throw_unfit("it has other sizes");
  for (const LabelEntry& entry : labels.labels) {
    if (!entry.values.empty()) throw_unfit("its labels share samples");
  }
  double smallest = images.spacing[0];
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::size_t>(axis);
    const Place ours = volume::step_of(images, axis);
    const Place theirs = volume::step_of(labels.geometry, static_cast<int>(grid.axes[at]));
    grid.steps[at] = ours;
    grid.is_flipped[at] = ours[0] * theirs[0] + ours[1] * theirs[1] + ours[2] * theirs[2] < 0;
    smallest = std::min(smallest, images.spacing[at]);
  }
  // The corners decide: everything else lies between them.
  constexpr double kTolerance = 0.05;  // of a sample
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> here = {};
    std::array<double, 3> there = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double last = dims[axis] - 1.0;
      here[axis] = (corner >> axis & 1U) != 0 ? last : 0;
      there.at(grid.axes[axis]) = grid.is_flipped[axis] ? last - here[axis] : here[axis];
    }
    if (!(distance(place_of(images, here), place_of(labels.geometry, there)) <=
          kTolerance * smallest)) {
      throw_unfit("its samples are not at the places of those of the images");
    }
  }
  return grid;
}

std::vector<dicom::SegmentationFrame> frames_of(const LabelGrid& grid,
                                                std::span<const std::int64_t> labels,
                                                const store::BlobStore& blobs,
                                                const std::stop_token& stop) {
  Occurrences found(labels, grid.dims[2]);
  if (grid.axes[2] == 0) {
    find_across_rows(grid, blobs, stop, found);
  } else {
    find_in_slices(grid, blobs, stop, found);
  }
  std::vector<dicom::SegmentationFrame> frames = found.frames();
  // Otherwise each segment would read all windows again, each of which may read the whole file.
  if (const std::uint32_t window = window_slices(grid); window > 1) {
    std::ranges::stable_sort(frames, {}, [&](const auto& frame) { return frame.slice / window; });
  }
  return frames;
}

void write_frames(const LabelGrid& grid, std::span<const std::int64_t> labels,
                  std::span<const dicom::SegmentationFrame> frames, const store::BlobStore& blobs,
                  const std::stop_token& stop,
                  const std::function<void(std::span<const std::byte>)>& write) {
  SliceReader reader(grid, blobs);
  std::vector<std::byte> bytes;
  std::uint64_t bits = 0;
  unsigned byte = 0;
  for (const dicom::SegmentationFrame& frame : frames) {
    check(stop);
    const std::int64_t label = labels[frame.segment - 1U];
    for (const std::int64_t sample : reader.read(frame.slice)) {
      if (sample == label) byte |= 1U << (bits % 8);
      if (++bits % 8 != 0) continue;
      bytes.push_back(static_cast<std::byte>(byte));
      byte = 0;
    }
    write(bytes);
    bytes.clear();
  }
  // The rest of the last byte, and a byte that makes the length even.
  for (; bits % 16 != 0; ++bits) {
    if (bits % 8 != 7) continue;
    bytes.push_back(static_cast<std::byte>(byte));
    byte = 0;
  }
  write(bytes);
}

}  // namespace isomesh::orders
