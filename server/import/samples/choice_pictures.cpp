#include "server/import/samples/choice_pictures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <optional>
#include <ranges>
#include <utility>
#include <vector>

#include "base/base64.h"
#include "server/import/samples/payload.h"

namespace isomesh::import {
namespace {

constexpr double kDarkest = 0.02;  // shares of the pixels
constexpr double kBrightest = 0.99;
constexpr double kMostPixels = double{1 << 20};  // of all pictures of an error

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

GreyWindow window_of(std::span<const double> values) {
  std::vector<double> finite;
  std::ranges::copy_if(values, std::back_inserter(finite),
                       [](double value) { return std::isfinite(value); });
  if (finite.empty()) return {};
  std::ranges::sort(finite);
  const auto at = [&](double share) {
    return finite[static_cast<std::size_t>(share * static_cast<double>(finite.size() - 1))];
  };
  return {at(kDarkest), std::max(at(kBrightest) - at(kDarkest), 1e-9)};
}

ChoicePicture picture_of(std::span<const double> values, std::uint32_t width,
                         const GreyWindow& window) {
  std::vector<std::uint8_t> grey;
  for (const double value : values) {
    const double part = (value - window.black) / window.width;
    const double share = std::isfinite(value) ? std::clamp(part, 0.0, 1.0) : 0.0;
    grey.push_back(static_cast<std::uint8_t>(std::lround(255 * share)));
  }
  return {.width = width,
          .height = static_cast<std::uint32_t>(values.size() / width),
          .grey = to_base64(grey)};
}

Error with_pictures(const Error& error, const InputFile& file, const SourceVolume& source,
                    const std::filesystem::path& scratch) {
  Remedy remedy = error.remedy();
  const bool is_plain = source.encoding == Encoding::kRaw && source.data_files.size() < 2 &&
                        source.stored_axes == kXFastest;
  const VolumeOfFile& volumes = source.chosen;
  if (!is_plain || volumes.run != 0 || volumes.count < remedy.choices.size()) return error;
  const double room = std::sqrt(kMostPixels / static_cast<double>(remedy.choices.size()));
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
