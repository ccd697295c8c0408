#include "server/import/samples/volume_pictures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "server/import/samples/payload.h"
#include "server/import/source/choice_picture.h"

namespace isomesh::import {
namespace {

constexpr double kMostPixelsOfAll = double{1 << 20};  // of all pictures of an error

// The first or second axis of a slice runs against the direction in which pictures of patients are
// drawn: to the left of the patient, to the back, and to the feet.
bool is_reversed(const Geometry& geometry, std::size_t axis) {
  const Vector3 step = step_of(geometry, static_cast<int>(axis));
  const auto length = [](double part) { return std::abs(part); };
  const auto most = std::ranges::max_element(step, {}, length);
  const bool is_along_body = most == step.end() - 1;
  return (*most < 0) != is_along_body;
}

// Every so many samples of the slices in the middle of volumes.
class MiddleSlices {
 public:
  MiddleSlices(const Payload& payload, const SourceVolume& source, std::uint32_t side)
      : payload_(payload), source_(source) {
    const auto& [width, height, depth] = source.dims;
    const std::uint32_t step = (std::max(width, height) + side - 1) / side;
    columns_ = steps(width, step, is_reversed(source.geometry, 0));
    rows_ = steps(height, step, is_reversed(source.geometry, 1));
  }

  std::uint32_t width() const { return static_cast<std::uint32_t>(columns_.size()); }

  std::vector<double> of(std::uint64_t volume) const {
    const auto& [width, height, depth] = source_.dims;
    const SampleLayout& layout = payload_.layout();
    const SampleType type = canonical_type(layout);
    std::vector<std::byte> row(width * isomesh::bytes_per_sample(type));
    std::vector<double> values;
    for (const std::uint32_t y : rows_) {
      const std::uint64_t first = ((volume * depth + depth / 2) * height + y) * width;
      read_samples(payload_.file(), payload_.offset() + first * bytes_per_sample(layout.type),
                   layout, row);
      with_sample(type, [&](auto sample) {
        using Sample = decltype(sample);
        const auto* samples = reinterpret_cast<const Sample*>(row.data());
        for (const std::uint32_t x : columns_) values.push_back(static_cast<double>(samples[x]));
      });
    }
    return values;
  }

 private:
  static std::vector<std::uint32_t> steps(std::uint32_t count, std::uint32_t step, bool reversed) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t at = 0; at < count; at += step) {
      places.push_back(reversed ? count - 1 - at : at);
    }
    return places;
  }

  const Payload& payload_;
  const SourceVolume& source_;
  std::vector<std::uint32_t> columns_;
  std::vector<std::uint32_t> rows_;
};

}  // namespace

Error with_pictures(const Error& error, const InputFile& file, const SourceVolume& source,
                    const std::filesystem::path& scratch) {
  Remedy remedy = error.remedy();
  const bool is_plain = source.encoding == Encoding::kRaw && source.data_files.size() < 2 &&
                        source.storage_order == kXFastest;
  const VolumeOfFile& volumes = source.chosen;
  if (!is_plain || volumes.run != 0 || volumes.count < remedy.choices.size()) return error;
  const double room = std::sqrt(kMostPixelsOfAll / static_cast<double>(remedy.choices.size()));
  try {
    const Payload payload(file, source, scratch);
    const MiddleSlices slices(payload, source,
                              std::min(kMostPictureSide, static_cast<std::uint32_t>(room)));
    std::optional<GreyWindow> window;
    for (std::size_t at = 0; at < remedy.choices.size(); ++at) {
      const std::vector<double> values = slices.of(at);
      if (!window) window = window_of(values);
      remedy.choices[at].picture = picture_of(values, slices.width(), *window);
    }
  } catch (const Error& unreadable) {
    // The volume that is chosen says what is wrong with it.
    if (unreadable.code() != ErrorCode::kUnusableVolume) throw;
    return error;
  }
  return error.with_remedy(std::move(remedy));
}

}  // namespace isomesh::import
