#include "server/import/samples/layers.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "server/import/labels/combinations.h"

namespace isomesh::import {
namespace {

using State = Combinations::State;
using Labels = std::map<std::pair<std::uint64_t, std::int64_t>, std::uint32_t>;

constexpr std::size_t kLayerPieceBytes = std::size_t{1} << 20;  // of all layers

std::uint32_t highest_label(const Labels& labels) {
  std::uint32_t highest = 0;
  for (const auto& [place, label] : labels) highest = std::max(highest, label);
  return highest;
}

// Reads the same samples of all layers, and combines their segments.
template <class Sample>
class LayerReader {
 public:
  LayerReader(const PlainSamples& samples, const SourceVolume& source)
      : samples_(samples),
        source_(source),
        labels_(source.layers->labels),
        at_once_(
            std::max<std::size_t>(kLayerPieceBytes / sizeof(Sample) / source.chosen.count, 1)) {}

  void read(std::uint64_t first, std::vector<State>& states, Combinations& combinations) {
    const std::uint64_t layers = source_.chosen.count;
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(at_once_, source_.sample_count() - first));
    values_.resize(count * layers);
    read_values(first, count);
    states.assign(count, Combinations::kNone);
    const bool interleaved = source_.layers->is_interleaved;
    for (std::size_t at = 0; at < count; ++at) {
      found_.clear();
      for (std::uint64_t layer = 0; layer < layers; ++layer) {
        const Sample value = values_[interleaved ? at * layers + layer : layer * count + at];
        if (value != 0) found_.push_back(label_of(layer, value, combinations));
      }
      std::ranges::sort(found_);
      for (const std::uint32_t label : found_) states[at] = combinations.with(states[at], label);
    }
  }

 private:
  void read_values(std::uint64_t first, std::size_t count) {
    const std::uint64_t stored = bytes_per_sample(samples_.layout.type);
    const std::span<std::byte> bytes = std::as_writable_bytes(std::span(values_));
    const std::uint64_t layers = source_.chosen.count;
    if (source_.layers->is_interleaved) {
      return read_samples(samples_.file, samples_.offset + first * layers * stored, samples_.layout,
                          bytes);
    }
    const std::size_t share = count * sizeof(Sample);
    for (std::uint64_t layer = 0; layer < layers; ++layer) {
      const std::uint64_t place = layer * source_.sample_count() + first;
      read_samples(samples_.file, samples_.offset + place * stored, samples_.layout,
                   bytes.subspan(layer * share, share));
    }
  }

  std::uint32_t label_of(std::uint64_t layer, Sample value, Combinations& combinations) {
    const std::pair<std::uint64_t, std::int64_t> place = {layer, value};
    if (place != last_place_) {
      auto found = labels_.find(place);
      if (found == labels_.end()) {
        found = labels_.emplace(place, combinations.new_label()).first;
      }
      last_place_ = place;
      last_label_ = found->second;
    }
    return last_label_;
  }

  const PlainSamples& samples_;
  const SourceVolume& source_;
  Labels labels_;
  const std::size_t at_once_;
  std::vector<Sample> values_;
  std::vector<std::uint32_t> found_;
  std::pair<std::uint64_t, std::int64_t> last_place_ = {0, 0};
  std::uint32_t last_label_ = 0;
};

// Returns empty if the type is too small.
template <class Sample>
std::optional<Combinations> write_states(const PlainSamples& samples, const SourceVolume& source,
                                         SampleType type, std::span<std::byte> target) {
  LayerReader<Sample> reader(samples, source);
  Combinations combinations(highest_label(source.layers->labels));
  std::vector<State> states;
  for (std::uint64_t first = 0; first < source.sample_count(); first += states.size()) {
    reader.read(first, states, combinations);
    const std::size_t bytes = states.size() * isomesh::bytes_per_sample(type);
    if (!combinations.write(states, type, target.first(bytes))) return std::nullopt;
    target = target.subspan(bytes);
  }
  return combinations;
}

}  // namespace

Volume write_layers(const PlainSamples& samples, const SourceVolume& source, Volume volume,
                    const std::filesystem::path& target) {
  for (const SampleType type : {SampleType::kUint8, SampleType::kUint16}) {
    volume.type = type;
    CanonicalWriter writer(target, {volume.dims, type, volume.geometry});
    const auto combinations = with_sample(
        canonical_type(samples.layout), [&](auto sample) -> std::optional<Combinations> {
          using Sample = decltype(sample);
          if constexpr (std::is_integral_v<Sample>) {
            return write_states<Sample>(samples, source, type, writer.samples());
          } else {
            throw Error(ErrorCode::kInternal,
                        "The layers of a segmentation must hold whole numbers.");
          }
        });
    if (!combinations) continue;
    volume.labels = combinations->entries(source.labels);
    if (auto note = combinations->note()) volume.notes.push_back(std::move(*note));
    return finish(writer, std::move(volume));
  }
  throw Error(ErrorCode::kInternal, "No sample type can hold the labels of a segmentation.");
}

}  // namespace isomesh::import
