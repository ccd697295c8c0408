#include "server/volume/preview.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "base/text.h"
#include "proto/samples.h"
#include "server/volume/grey.h"

namespace isomesh::volume {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

std::string vector_text(const std::array<double, 3>& vector) {
  return '(' + to_text(vector[0]) + ',' + to_text(vector[1]) + ',' + to_text(vector[2]) + ')';
}

using Dims = std::array<std::uint32_t, 3>;

Dims block_of(const Dims& dims, std::uint32_t most) {
  return {(dims[0] - 1) / most + 1, (dims[1] - 1) / most + 1, (dims[2] - 1) / most + 1};
}

Dims reduced(const Dims& dims, const Dims& block) {
  return {(dims[0] - 1) / block[0] + 1, (dims[1] - 1) / block[1] + 1, (dims[2] - 1) / block[2] + 1};
}

}  // namespace

PreviewNrrd::PreviewNrrd(std::shared_ptr<const CanonicalFile> volume, const PreviewChoice& choice)
    : volume_(std::move(volume)),
      choice_(choice),
      block_(block_of(volume_->header().dims, choice.most)),
      dims_(reduced(volume_->header().dims, block_)),
      thin_(dims_[0], dims_[1]) {
  begin_layer();
}

std::string PreviewNrrd::header() const {
  const Geometry& geometry = volume_->header().geometry;
  std::array<double, 3> origin = geometry.origin;
  std::string directions;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::array<double, 3> step = {};
    for (std::size_t row = 0; row < 3; ++row) {
      step[row] = geometry.direction[3 * row + axis] * geometry.spacing[axis];
      origin[row] += step[row] * (block_[axis] - 1) / 2.0;
      step[row] *= block_[axis];
    }
    directions += ' ' + vector_text(step);
  }
  return "NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: " +
         std::to_string(dims_[0]) + ' ' + std::to_string(dims_[1]) + ' ' +
         std::to_string(dims_[2]) + "\nspace directions:" + directions +
         "\nspace origin: " + vector_text(origin) + "\nencoding: raw\n\n";
}

std::uint64_t PreviewNrrd::size() const {
  return header().size() + std::uint64_t{dims_[0]} * dims_[1] * dims_[2];
}

std::optional<std::string_view> PreviewNrrd::next() {
  bytes_.clear();
  if (!std::exchange(has_begun_, true)) {
    bytes_ = header();
    return bytes_;
  }
  if (slice_ == volume_->header().dims[2]) return std::nullopt;
  std::uint64_t samples = 0;
  while (samples < kSamplesPerPiece && slice_ < volume_->header().dims[2]) samples += add_rows();
  return bytes_;
}

// Adds rows of one slice, and returns their number of samples.
std::uint64_t PreviewNrrd::add_rows() {
  const CanonicalHeader& header = volume_->header();
  const std::uint64_t width = header.dims[0];
  const auto count = static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(kSamplesPerPiece / width, 1, header.dims[1] - row_));
  const std::size_t sample_bytes = bytes_per_sample(header.type);
  rows_.resize(count * width * sample_bytes);
  const std::uint64_t first = (std::uint64_t{slice_} * header.dims[1] + row_) * width;
  volume_->read(first * sample_bytes, rows_);
  with_sample(header.type, [&](auto sample) {
    for (std::uint32_t n = 0; n < count; ++n) {
      add_row<decltype(sample)>(&rows_[n * width * sample_bytes], row_ + n);
    }
  });
  row_ += count;
  if (row_ < header.dims[1]) return count * width;
  row_ = 0;
  ++slice_;
  if (slice_ % block_[2] == 0 || slice_ == header.dims[2]) end_layer();
  return count * width;
}

template <class Sample>
void PreviewNrrd::add_row(const std::byte* samples, std::size_t row) {
  const std::uint32_t width = volume_->header().dims[0];
  const std::size_t line = row / block_[1] * dims_[0];
  for (std::uint32_t cell = 0, begin = 0; cell < dims_[0]; ++cell, begin += block_[0]) {
    const std::uint32_t end = std::min(width, begin + block_[0]);
    double sum = 0;
    Sample least = std::numeric_limits<Sample>::max();
    Sample greatest = std::numeric_limits<Sample>::lowest();
    std::uint32_t count = end - begin;
    for (std::uint32_t at = begin; at < end; ++at) {
      Sample sample;
      std::memcpy(&sample, samples + std::size_t{at} * sizeof(Sample), sizeof(Sample));
      if constexpr (std::is_floating_point_v<Sample>) {
        if (std::isnan(sample)) {
          --count;
          continue;
        }
      }
      sum += static_cast<double>(sample);
      least = std::min(least, sample);
      greatest = std::max(greatest, sample);
    }
    sums_[line + cell] += sum;
    counts_[line + cell] += count;
    if (count == 0) continue;
    least_[line + cell] = std::min(least_[line + cell], static_cast<double>(least));
    greatest_[line + cell] = std::max(greatest_[line + cell], static_cast<double>(greatest));
  }
}

void PreviewNrrd::begin_layer() {
  const std::size_t count = std::size_t{dims_[0]} * dims_[1];
  sums_.assign(count, 0);
  counts_.assign(count, 0);
  least_.assign(count, kNone);
  greatest_.assign(count, -kNone);
}

void PreviewNrrd::end_layer() {
  ThinParts::Layer layer;
  for (std::size_t at = 0; at < sums_.size(); ++at) {
    // Without any number the mean is NaN, which is black.
    const bool has_any = counts_[at] > 0;
    layer.mean.push_back(grey(sums_[at] / counts_[at], choice_.window));
    layer.least.push_back(has_any ? grey(least_[at], choice_.window) : 0);
    layer.greatest.push_back(has_any ? grey(greatest_[at], choice_.window) : 0);
  }
  begin_layer();
  ++read_;
  if (!is_reduced()) {
    bytes_.append(layer.mean.begin(), layer.mean.end());
    return;
  }
  layers_.push_back(thin_.known(std::move(layer)));
  while (written_ < read_ && (read_ == dims_[2] || written_ + ThinParts::kReach < read_)) {
    write_layer();
  }
}

bool PreviewNrrd::is_reduced() const {
  return std::ranges::any_of(block_, [](std::uint32_t count) { return count > 1; });
}

void PreviewNrrd::write_layer() {
  constexpr std::uint32_t kReach = ThinParts::kReach;
  const std::size_t first = read_ - layers_.size();
  ThinParts::NeighbouringLayers around = {};
  for (std::uint32_t at = 0; at < around.size(); ++at) {
    const std::uint32_t layer = std::max(written_ + at, kReach) - kReach;
    around[at] = &layers_[std::min(layer, read_ - 1) - first];
  }
  const ThinParts::Greys kept = thin_.kept(around);
  bytes_.append(kept.begin(), kept.end());
  ++written_;
  if (written_ > kReach + first) layers_.pop_front();
}

}  // namespace isomesh::volume
