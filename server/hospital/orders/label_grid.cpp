#include "server/hospital/orders/label_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <optional>

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

// Reads slices of the label volume as the images have them.
class SliceReader {
 public:
  SliceReader(const LabelGrid& grid, const store::BlobStore& blobs)
      : grid_(grid),
        samples_(blobs.open(grid.samples)),
        raw_(std::size_t{grid.dims[0]} * grid.dims[1] * bytes_per_sample(grid.type)),
        labels_(std::size_t{grid.dims[0]} * grid.dims[1]) {}

  std::span<const std::int64_t> read(std::uint32_t slice) {
    if (current_ == slice) return labels_;
    const std::uint64_t there = grid_.is_flipped[2] ? grid_.dims[2] - 1 - slice : slice;
    if (samples_->read_at(volume::kHeaderBytes + there * raw_.size(), raw_) != raw_.size()) {
      throw Error(ErrorCode::kInternal, "a stored label volume became shorter");
    }
    with_sample(grid_.type, [&](auto sample) { decode<decltype(sample)>(); });
    current_ = slice;
    return labels_;
  }

 private:
  template <class Sample>
  void decode() {
    const std::size_t columns = grid_.dims[0];
    const std::size_t rows = grid_.dims[1];
    for (std::size_t row = 0; row < rows; ++row) {
      const std::size_t from = (grid_.is_flipped[1] ? rows - 1 - row : row) * columns;
      for (std::size_t column = 0; column < columns; ++column) {
        const std::size_t at = from + (grid_.is_flipped[0] ? columns - 1 - column : column);
        Sample value;
        std::memcpy(&value, raw_.data() + at * sizeof(Sample), sizeof(Sample));
        labels_[row * columns + column] = label_of(value);
      }
    }
  }

  template <class Sample>
  static std::int64_t label_of(Sample value) {
    if constexpr (std::is_floating_point_v<Sample>) {
      return volume::is_nearly_whole(value) ? volume::whole_number(value) : 0;
    } else {
      return static_cast<std::int64_t>(value);
    }
  }

  const LabelGrid& grid_;
  const std::unique_ptr<const store::BlobReader> samples_;
  std::vector<std::byte> raw_;
  std::vector<std::int64_t> labels_;
  std::optional<std::uint32_t> current_;
};

void check(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
}

}  // namespace

LabelGrid label_grid(const Geometry& images, const std::array<std::uint32_t, 3>& dims,
                     const Volume& labels) {
  if (labels.dims != dims) throw_unfit("it has other sizes");
  for (const LabelEntry& entry : labels.labels) {
    if (!entry.values.empty()) throw_unfit("its labels share samples");
  }
  LabelGrid grid = {
      .dims = dims, .type = labels.type, .samples = labels.samples, .origin = images.origin};
  double smallest = images.spacing[0];
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::size_t>(axis);
    const Place ours = volume::step_of(images, axis);
    const Place theirs = volume::step_of(labels.geometry, axis);
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
      there[axis] = grid.is_flipped[axis] ? last - here[axis] : here[axis];
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
  std::map<std::int64_t, std::size_t> places;
  for (std::size_t place = 0; place < labels.size(); ++place) places[labels[place]] = place;
  std::vector<std::vector<std::uint32_t>> slices(labels.size());
  std::size_t count = 0;
  SliceReader reader(grid, blobs);
  for (std::uint32_t slice = 0; slice < grid.dims[2]; ++slice) {
    check(stop);
    std::optional<std::int64_t> last;
    for (const std::int64_t label : reader.read(slice)) {
      if (label == last) continue;
      last = label;
      const auto found = places.find(label);
      if (found == places.end()) continue;
      std::vector<std::uint32_t>& known = slices[found->second];
      if (!known.empty() && known.back() == slice) continue;
      known.push_back(slice);
      dicom::check_frames(++count);
    }
  }
  std::vector<dicom::SegmentationFrame> frames;
  for (std::size_t place = 0; place < labels.size(); ++place) {
    for (const std::uint32_t slice : slices[place]) {
      frames.push_back({.segment = static_cast<std::uint16_t>(place + 1), .slice = slice});
    }
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
