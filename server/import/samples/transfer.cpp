#include "server/import/samples/transfer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/error.h"
#include "proto/samples.h"
#include "server/import/labels/closed_ends.h"
#include "server/import/labels/combinations.h"
#include "server/import/samples/payload.h"
#include "server/import/samples/wide_labels.h"
#include "server/volume/geometry.h"
#include "server/volume/labels.h"
#include "server/volume/sample_order.h"
#include "server/volume/statistics.h"

namespace isomesh::import {
namespace {

constexpr const char* kNoSpacing = "The file does not say how far apart its samples are.";

// `example` is one that the request may give.
[[noreturn]] void throw_no_spacing(const std::string& why, const Vector3& example) {
  const auto& [x, y, z] = example;
  const bool is_one = x == y && x == z;
  throw_choice(why + " Give the distances along x, y and z in millimetres: spacing=X,Y,Z.",
               {{"spacing", to_text(x) + ',' + to_text(y) + ',' + to_text(z),
                 (is_one ? to_text(x) : to_text(x) + ", " + to_text(y) + " and " + to_text(z)) +
                     " mm along x, y and z"}});
}

// Why the request may replace the file's own spacing; empty if it may not.
std::string fault_of_spacing(const SourceVolume& source, const Geometry& geometry) {
  if (source.unknown_unit) return source.unknown_unit->why;
  const auto fault = find_fault(source.dims, geometry);
  const bool is_length = std::ranges::all_of(
      geometry.spacing, [](double size) { return std::isfinite(size) && size > 0; });
  // A unit that is far too small or too large.
  if (!fault || fault->field != "spacing" || !is_length) return {};
  return "The file's geometry cannot be used: " + fault->message + '.';
}

// Gives the lattice another spacing. Its first sample stays as many steps from the origin of space,
// because the unit of its place is that of the spacing.
void change_unit(const Vector3& spacing, Geometry& geometry) {
  Vector3 rest = geometry.origin;  // without its parts along the axes; 0 if they are perpendicular
  Vector3 origin = {0, 0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double factor = spacing[axis] / geometry.spacing[axis];
    double along = 0;
    for (std::size_t row = 0; row < 3; ++row) {
      along += geometry.direction[row * 3 + axis] * geometry.origin[row];
    }
    for (std::size_t row = 0; row < 3; ++row) {
      const double part = geometry.direction[row * 3 + axis] * along;
      origin[row] += part * factor;
      rest[row] -= part;
    }
  }
  const double factor = spacing[0] / geometry.spacing[0];
  for (std::size_t row = 0; row < 3; ++row) origin[row] += rest[row] * factor;
  geometry.origin = origin;
  geometry.spacing = spacing;
}

// The spacing in proportion, for an example.
Vector3 proportions(const Vector3& spacing) {
  Vector3 result = spacing;
  for (double& size : result) size /= std::ranges::min(spacing);
  return result;
}

// The geometry of a file that has a spacing, or of the request's.
Geometry spaced_geometry(const SourceVolume& source, const ImportOptions& options) {
  Geometry geometry = normalised(source.geometry);
  const std::string fault = fault_of_spacing(source, geometry);
  const bool is_told = source.has_spacing && !source.assumes_spacing;
  if (is_told && fault.empty()) refuse_spacing(options);
  if (options.spacing && fault.empty()) {
    geometry.spacing = *options.spacing;
  } else if (options.spacing) {
    change_unit(*options.spacing, geometry);
  } else if (!source.has_spacing) {
    throw_no_spacing(kNoSpacing, {1, 1, 1});
  } else if (!fault.empty() && !(source.unknown_unit && source.unknown_unit->is_assumed)) {
    throw_no_spacing(fault, source.unknown_unit ? geometry.spacing : proportions(geometry.spacing));
  }
  return geometry;
}

void note_assumed_spacing(const SourceVolume& source, const ImportOptions& options,
                          Volume& volume) {
  const std::string_view code = describe(NoteCode::kUnitUnknown).name;
  if (options.spacing || std::ranges::find(volume.notes, code, &Note::code) != volume.notes.end()) {
    return;
  }
  const Vector3& spacing = volume.geometry.spacing;
  if (source.unknown_unit) {
    volume.notes.push_back(note_of(
        NoteCode::kUnitUnknown, source.unknown_unit->why +
                                    " One unit was read as one millimetre. spacing=X,Y,Z gives the "
                                    "distances between samples in mm."));
  } else if (source.assumes_spacing) {
    volume.notes.push_back(note_of(
        NoteCode::kUnitUnknown,
        std::string(kNoSpacing) + ' ' + to_text(spacing[0]) + ", " + to_text(spacing[1]) + " and " +
            to_text(spacing[2]) +
            " mm along x, y and z were assumed. spacing=X,Y,Z gives other distances in mm."));
  }
}

Geometry usable_geometry(const SourceVolume& source, const ImportOptions& options) {
  const Geometry geometry = normalised(spaced_geometry(source, options));
  if (const auto fault = find_fault(source.dims, geometry)) {
    throw_unusable("The file's geometry cannot be used: " + fault->message + ".");
  }
  return geometry;
}

template <class IsReplaced>
void replace(std::span<std::byte> samples, SampleType type, double value,
             const IsReplaced& is_replaced) {
  with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    if constexpr (std::is_floating_point_v<Sample>) {
      auto* first = reinterpret_cast<Sample*>(samples.data());
      std::replace_if(first, first + samples.size() / sizeof(Sample), is_replaced,
                      static_cast<Sample>(value));
    }
  });
}

// The smallest sample is outside for every iso-value above it, and keeps the adjacent surface in
// place. Labels above 0 have the background 0 instead: the smallest is a label of its own.
void replace_non_finite(std::span<std::byte> samples, SampleType type, double smallest) {
  replace(samples, type, std::min(smallest, 0.0), [](auto value) { return !std::isfinite(value); });
  if (smallest <= 0 || volume::whole_numbers(samples, type)) return;
  replace(samples, type, smallest, [](auto value) { return value == 0; });
}

bool is_wide_integer(const SampleLayout& layout) {
  return !layout.rescale &&
         (layout.type == StoredType::kUint64 || layout.type == StoredType::kInt64);
}

// Floats with few values in flat regions are labels. Two values may as well be a mask that is to
// stay what it is: jobs by labels round it.
bool are_like_labels(std::span<const std::byte> samples, const Volume& volume) {
  return volume::label_count(samples, volume.type, volume.dims).value_or(0) > 2;
}

// Labels are integers: labels of floats become some, and so do 64-bit integers that fit. Returns
// true if the samples were converted. `volume` has their range.
bool store_whole_numbers(const SampleKind& kind, std::span<std::byte> samples, Volume& volume) {
  if (is_integer(volume.type)) return false;
  const auto numbers = volume::whole_numbers(samples, volume.type);
  if (!numbers) return false;
  if (!kind.are_wide && !kind.are_labels && volume.labels.empty() &&
      !are_like_labels(samples, volume)) {
    return false;
  }
  volume::store_whole(samples, volume.type, numbers->type, samples.data());
  if (!numbers->is_exact) volume.notes.push_back(volume::rounded_note(volume.type));
  volume.type = numbers->type;
  return true;
}

// A palette colours pictures, too. These have many colours.
bool may_be_labels(std::span<const std::byte> samples, const Volume& volume) {
  constexpr std::size_t kFew = 16;
  if (volume.labels.size() <= kFew) return true;
  if (!is_integer(volume.type) && !volume::whole_numbers(samples, volume.type)) return false;
  return volume::label_count(samples, volume.type, volume.dims).has_value();
}

auto find_labels_note(Volume& volume) {
  return std::ranges::find(volume.notes, describe(NoteCode::kLooksLikeLabels).name, &Note::code);
}

Note labels_note(const std::string& reason) {
  return note_of(NoteCode::kLooksLikeLabels,
                 reason +
                     ". Use \"labels\": \"all\" to mesh each label. An iso-value makes one "
                     "surface around all samples above it.");
}

// Completes the note on labels, if there is one.
void note_stored_type(const std::string& stored, Volume& volume) {
  const auto note = find_labels_note(volume);
  if (note == volume.notes.end()) return;
  note->detail += " The whole numbers, " + stored + " in the file, are now " +
                  std::string(to_string(volume.type)) + '.';
}

// A mask has no grey values that would tell where between two samples its surface lies.
Note mask_note(std::int64_t value) {
  return note_of(NoteCode::kLooksLikeLabels,
                 "The samples are a mask: each is 0 or " + std::to_string(value) +
                     ". At an iso-value, small structures lose volume. With \"labels\": \"all\" "
                     "they keep it.");
}

// Declared labels are certain; otherwise the samples may look like labels. Floats may if all are
// nearly whole.
void note_labels(std::span<const std::byte> samples, Volume& volume) {
  if (!is_integer(volume.type) && !volume::whole_numbers(samples, volume.type)) return;
  const auto is_told = [](const LabelEntry& entry) { return !entry.name.empty() || entry.color; };
  const auto told = static_cast<std::size_t>(std::ranges::count_if(volume.labels, is_told));
  const bool are_known = !volume.labels.empty();  // maybe without being told, like wide labels
  const auto mask =
      are_known ? std::nullopt : volume::mask_value(samples, volume.type, volume.range);
  if (mask) return volume.notes.push_back(mask_note(*mask));
  const auto values = are_known ? std::optional(volume.labels.size())
                                : volume::label_count(samples, volume.type, volume.dims);
  if (!values) return;
  const std::string what =
      told > 0 ? "The file describes " + std::to_string(told) + (told == 1 ? " label" : " labels")
      : are_known ? "The samples have " + std::to_string(*values) +
                        (*values == 1 ? " label" : " labels") + " without a name"
                  : "The samples look like labels: they have " + std::to_string(*values) +
                        " different whole values in flat regions";
  volume.notes.push_back(labels_note(what));
}

// The header alone says so: the samples need not look like labels.
void note_declared_labels(Volume& volume) {
  if (!is_integer(volume.type) || find_labels_note(volume) != volume.notes.end()) return;
  volume.notes.push_back(labels_note("The file says that its samples are labels"));
}

// --- Layers of a segmentation --------------------------------------------------------------------

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

// Writes the canonical file of all layers as one label map, whose samples are numbers of
// combinations of segments (combinations.h). Returns the volume as finish() does, with its labels.
// `samples` are those of all layers. Values without a segment become labels without a name. Throws
// Error kUnusableVolume also if there are too many combinations.
Volume write_layers(const PlainSamples& samples, const SourceVolume& source, Volume volume,
                    const ImportTask& task) {
  for (const SampleType type : {SampleType::kUint8, SampleType::kUint16}) {
    volume.type = type;
    const auto dims =
        source.is_segmentation ? with_room(volume.dims, type, task.limits) : volume.dims;
    CanonicalWriter writer(task.target, {dims, type, volume.geometry});
    auto combinations = with_sample(
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
    combinations->sort_values(
        type, writer.samples().first(volume.sample_count() * isomesh::bytes_per_sample(type)));
    volume.labels = combinations->entries(source.labels);
    if (auto note = combinations->note()) volume.notes.push_back(std::move(*note));
    return finish(writer, std::move(volume), {.is_segmentation = source.is_segmentation});
  }
  throw Error(ErrorCode::kInternal, "No sample type can hold the labels of a segmentation.");
}

// Sizes and geometry in the order in which the samples are stored, which may not be that of the
// header's axes.
void take_storage_order(const StorageOrder& fastest, Volume& volume) {
  volume.stored_axes = volume::axis_codes(volume.geometry);
  volume::AxisOrder order = {};
  std::ranges::transform(fastest, order.begin(),
                         [](std::size_t axis) { return static_cast<int>(axis) + 1; });
  volume.geometry = volume::in_order(volume.dims, volume.geometry, order);
  volume.dims = volume::in_order(volume.dims, order);
}

}  // namespace

void put_in_order(CanonicalWriter& writer, Volume& volume) {
  if (!volume.stored_axes) volume.stored_axes = volume::axis_codes(volume.geometry);
  volume::make_canonical(writer.samples(), volume);
}

Volume write_canonical(const PlainSamples& samples, Volume volume, const ImportTask& task) {
  if (auto labels = write_wide_labels(samples, volume, task)) return *std::move(labels);
  volume.type = canonical_type(samples.layout);
  const auto dims =
      samples.is_segmentation ? with_room(volume.dims, volume.type, task.limits) : volume.dims;
  CanonicalWriter writer(task.target, {dims, volume.type, volume.geometry});
  const std::span<std::byte> stored =
      writer.samples().first(volume.sample_count() * bytes_per_sample(volume.type));
  read_samples(samples.file, samples.offset, samples.layout, stored);
  put_in_order(writer, volume);
  if (samples.labels_if_flat && !may_be_labels(stored, volume)) volume.labels.clear();
  volume = finish(writer, std::move(volume),
                  {.are_labels = samples.are_labels,
                   .are_wide = is_wide_integer(samples.layout),
                   .is_segmentation = samples.is_segmentation});
  if (!is_integer(volume.type)) volume.labels.clear();
  return volume;
}

Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task) {
  if (!source.is_segmentation) refuse_flat("The file", source.dims);
  Volume volume;
  volume.dims = source.dims;
  volume.geometry = usable_geometry(source, task.options);
  // Raw samples are compared with the file's size first, so that a truncated file is reported as
  // truncated even if its header declares more samples than allowed.
  if (source.encoding != Encoding::kRaw) check_limits(source, task.limits);
  const Payload payload(file, source, task.scratch);
  check_limits(source, task.limits);
  volume.notes = source.notes;
  note_assumed_spacing(source, task.options, volume);
  std::ranges::copy(payload.notes(), std::back_inserter(volume.notes));
  take_storage_order(source.storage_order, volume);
  if (source.layers)
    return write_layers({payload.file(), payload.offset(), payload.layout()}, source,
                        std::move(volume), task);
  volume.labels = source.labels;
  return write_canonical({payload.file(), payload.offset(), payload.layout(), source.are_labels,
                          source.is_segmentation, source.labels_if_flat},
                         std::move(volume), task);
}

Volume finish(CanonicalWriter& writer, Volume volume, const SampleKind& kind) {
  put_in_order(writer, volume);
  const auto samples =
      writer.samples().first(volume.sample_count() * bytes_per_sample(volume.type));
  std::uint64_t left_out = kind.left_out;
  volume::Statistics statistics = volume::measure(samples, volume.type, left_out);
  if (statistics.non_finite > 0) {
    const std::string count = std::to_string(statistics.non_finite) + " of the " +
                              std::to_string(volume.sample_count()) +
                              " samples are not finite numbers";
    if (statistics.non_finite == volume.sample_count()) throw_unusable(count + ".");
    replace_non_finite(samples, volume.type, statistics.range[0]);
    left_out += statistics.non_finite;
    statistics = volume::measure(samples, volume.type, left_out);
    volume.notes.push_back(note_of(
        NoteCode::kNonFiniteSamples,
        count + ". At iso-values above the smallest sample they lie outside the surface, or "
                "inside it with inside=below."));
  }
  volume.range = statistics.range;
  const std::string stored =
      kind.are_wide ? "64-bit integers" : std::string(to_string(volume.type));
  const bool is_converted = store_whole_numbers(kind, samples, volume);
  const bool is_closed = kind.is_segmentation && is_integer(volume.type);
  if (is_closed) {
    close_ends(writer, volume);
    put_in_order(writer, volume);  // for the numbers of the new origin
  }
  writer.shorten({volume.dims, volume.type, volume.geometry});
  if (kind.is_segmentation || is_converted) {
    statistics = volume::measure(writer.samples(), volume.type, left_out);
    volume.range = statistics.range;
  }
  note_labels(writer.samples(), volume);
  if (kind.are_labels) note_declared_labels(volume);
  if (is_converted) note_stored_type(stored, volume);
  volume.suggested_iso = statistics.otsu;
  volume.bytes = writer.samples().size();
  return volume;
}

}  // namespace isomesh::import
