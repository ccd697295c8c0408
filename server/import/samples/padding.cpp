#include "server/import/samples/padding.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "proto/samples.h"
#include "server/import/source/source.h"
#include "server/volume/labels.h"
#include "server/volume/statistics.h"

namespace isomesh::import {
namespace {

// The finite samples of the image.
struct ImageSamples {
  bool is_empty = true;
  double smallest = 0;
  bool is_padding_zero = true;  // all padding has the value 0
};

template <class Sample>
ImageSamples scan(const std::vector<bool>& padding, std::span<const Sample> samples) {
  ImageSamples found;
  for (std::size_t at = 0; at < samples.size(); ++at) {
    const auto value = static_cast<double>(samples[at]);
    if (padding[at]) {
      found.is_padding_zero = found.is_padding_zero && value == 0;
    } else if (std::isfinite(value) && (found.is_empty || value < found.smallest)) {
      found.is_empty = false;
      found.smallest = value;
    }
  }
  return found;
}

template <class Sample>
void replace(const std::vector<bool>& padding, double value, std::span<Sample> samples) {
  for (std::size_t at = 0; at < samples.size(); ++at) {
    if (padding[at]) samples[at] = static_cast<Sample>(value);
  }
}

template <class Use>
auto with_samples(std::span<std::byte> bytes, SampleType type, const Use& use) {
  return with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    return use(std::span(reinterpret_cast<Sample*>(bytes.data()), bytes.size() / sizeof(Sample)));
  });
}

bool look_like_labels(std::span<const std::byte> samples, const Volume& volume) {
  return volume::label_count(samples, volume.type, volume.dims) ||
         volume::mask_value(samples, volume.type, volume::measure(samples, volume.type).range);
}

}  // namespace

std::uint64_t leave_out_padding(const std::vector<bool>& padding, const ImportOptions& options,
                                std::span<std::byte> samples, Volume& volume) {
  const auto count = static_cast<std::uint64_t>(std::ranges::count(padding, true));
  const std::string what = std::to_string(count) + " of the " +
                           std::to_string(volume.sample_count()) +
                           " samples have the padding value of the file";
  if (options.accepts(NoteCode::kPadding)) {
    volume.notes.push_back(
        note_of(NoteCode::kPadding,
                what + ". The request accepts padding, so they are samples like others."));
    return 0;
  }
  const ImageSamples image = with_samples(samples, volume.type, [&](auto typed) {
    return scan<typename decltype(typed)::value_type>(padding, typed);
  });
  if (image.is_empty) {
    throw_overridable(NoteCode::kPadding,
                      "All samples have the padding value of the file, so it holds no image." +
                          begin_remedy(options, "Add") +
                          "accept=padding to read them as samples like others.");
  }
  if (image.is_padding_zero && image.smallest > 0 && look_like_labels(samples, volume)) return 0;
  with_samples(samples, volume.type, [&](auto typed) { replace(padding, image.smallest, typed); });
  volume.notes.push_back(
      note_of(NoteCode::kPadding,
              what + ". At iso-values above the smallest sample they lie outside the surface."));
  return count;
}

}  // namespace isomesh::import
