#include "server/import/samples/padding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include "proto/samples.h"
#include "server/import/source/source.h"
#include "server/volume/labels.h"
#include "server/volume/statistics.h"

namespace isomesh::import {
namespace {

// The finite samples of the image.
struct ImageSamples {
  double smallest = std::numeric_limits<double>::infinity();  // if there is none
  bool is_padding_zero = true;                                // all padding has the value 0
};

template <class Sample>
void scan(std::span<const Sample> samples, std::uint64_t padding, ImageSamples& found) {
  for (std::size_t at = 0; at < samples.size(); ++at) {
    const auto value = static_cast<double>(samples[at]);
    if ((padding >> at & 1U) != 0) {
      found.is_padding_zero = found.is_padding_zero && value == 0;
    } else if (std::isfinite(value) && value < found.smallest) {
      found.smallest = value;
    }
  }
}

// Calls `use` for each block of samples, with the bits of its padding.
template <class Sample, class Use>
void for_blocks(const SampleSet& padding, std::span<Sample> samples, const Use& use) {
  for (std::size_t begin = 0; begin < samples.size(); begin += SampleSet::kBlock) {
    use(samples.subspan(begin, std::min(SampleSet::kBlock, samples.size() - begin)),
        padding.block(begin / SampleSet::kBlock));
  }
}

template <class Sample>
ImageSamples scan(const SampleSet& padding, std::span<Sample> samples) {
  ImageSamples found;
  for_blocks(padding, samples, [&](std::span<const Sample> block, std::uint64_t bits) {
    if (bits != 0) return scan(block, bits, found);
    if constexpr (std::is_integral_v<Sample>) {
      found.smallest = std::min(found.smallest, static_cast<double>(std::ranges::min(block)));
    } else {
      scan(block, 0, found);
    }
  });
  return found;
}

template <class Sample>
void replace(const SampleSet& padding, double value, std::span<Sample> samples) {
  for_blocks(padding, samples, [&](std::span<Sample> block, std::uint64_t bits) {
    for (; bits != 0; bits &= bits - 1) {
      block[static_cast<std::size_t>(std::countr_zero(bits))] = static_cast<Sample>(value);
    }
  });
}

template <class Use>
auto with_samples(std::span<std::byte> bytes, SampleType type, const Use& use) {
  return with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    return use(std::span(reinterpret_cast<Sample*>(bytes.data()), bytes.size() / sizeof(Sample)));
  });
}

bool look_like_labels(std::span<const std::byte> samples, const Volume& volume) {
  if (!is_integer(volume.type) && !volume::whole_numbers(samples, volume.type)) return false;
  return volume::label_count(samples, volume.type, volume.dims) ||
         volume::mask_value(samples, volume.type, volume::measure(samples, volume.type).range);
}

}  // namespace

std::uint64_t leave_out_padding(const SampleSet& padding, const ImportOptions& options,
                                std::span<std::byte> samples, Volume& volume) {
  const std::uint64_t count = padding.count();
  const std::string what = std::to_string(count) + " of the " +
                           std::to_string(volume.sample_count()) +
                           " samples have the padding value of the file";
  if (options.accepts(NoteCode::kPadding)) {
    volume.notes.push_back(
        note_of(NoteCode::kPadding,
                what + ". The request accepts padding, so they are samples like others."));
    return 0;
  }
  const ImageSamples image =
      with_samples(samples, volume.type, [&](auto typed) { return scan(padding, typed); });
  if (!std::isfinite(image.smallest)) {
    throw_overridable(
        NoteCode::kPadding,
        (count == volume.sample_count() ? "All samples have the padding value of the file"
                                        : what + ", and the others are not finite numbers") +
            ", so it holds no image." + begin_remedy(options, "Add") +
            "accept=padding to read them as samples like others.");
  }
  if (image.is_padding_zero && image.smallest > 0 && look_like_labels(samples, volume)) return 0;
  with_samples(samples, volume.type, [&](auto typed) { replace(padding, image.smallest, typed); });
  volume.notes.push_back(
      note_of(NoteCode::kPadding,
              what + ". At iso-values above the smallest sample they lie outside the surface, or "
                     "inside it with inside=below."));
  return count;
}

}  // namespace isomesh::import
