#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/formats/zarr_array.h"
#include "server/import/labels/label_table.h"
#include "server/import/samples/transfer.h"

namespace isomesh::import {
namespace {

constexpr std::uint64_t kMostChunks = 1'000'000;  // of a volume
constexpr std::size_t kMostDatasets = 64;

const Json& at(const Json& json, const char* name) {
  static const Json null;
  if (!json.is_object()) return null;
  const auto found = json.find(name);
  return found == json.end() ? null : *found;
}

std::string word(const Json& json) { return json.is_string() ? json.get<std::string>() : ""; }

// The group's metadata of OME: 0.5 has it below attributes of a `zarr.json`.
const Json& ome_of(const Json& group) {
  const Json& attributes = at(group, "attributes");
  return attributes.is_null() ? group : at(attributes, "ome");
}

bool has_key(std::string_view head, std::string_view key) {
  return head.find('"' + std::string(key) + '"') != std::string_view::npos;
}

// Consolidated metadata repeat those of all groups.
bool is_zarr(std::string_view head) {
  return trimmed(head.substr(0, 64)).starts_with('{') &&
         (has_key(head, "multiscales") || has_key(head, "image-label")) &&
         !has_key(head, ".zgroup") && !has_key(head, ".zattrs");
}

std::vector<std::string> dataset_paths(const Json& scales) {
  std::vector<std::string> paths;
  const Json& datasets = at(scales, "datasets");
  if (!datasets.is_array()) return paths;
  for (const Json& dataset : datasets) {
    if (paths.size() < kMostDatasets) paths.push_back(word(at(dataset, "path")));
  }
  return paths;
}

const Json& scales_of(const Json& group) {
  const Json& scales = at(ome_of(group), "multiscales");
  if (!scales.is_array() || scales.empty() || dataset_paths(scales[0]).empty()) {
    throw_unusable("The OME-Zarr's metadata has no multiscales with datasets.");
  }
  return scales[0];
}

// Everything in the arrays' folders, and metadata that no note should list.
std::vector<std::string> zarr_data_names(const InputFile& file, const Companions& companions) {
  const Json group = parse_json<Json>(file.text(0, kMostZarrHeaderBytes), nullptr, false);
  std::vector<std::string> paths;
  for (const Json& scales : at(ome_of(group), "multiscales")) {
    for (const std::string& path : dataset_paths(scales)) paths.push_back(path + "/");
  }
  constexpr std::array<std::string_view, 6> kBeside = {".zgroup",          ".zattrs",
                                                       "labels/.zattrs",   "labels/.zgroup",
                                                       "labels/zarr.json", "OME/METADATA.ome.xml"};
  std::vector<std::string> names;
  for (const auto& [name, path] : companions.all()) {
    const bool is_of_array = std::ranges::any_of(
        paths, [&](const std::string& folder) { return name.starts_with(folder); });
    const bool is_beside =
        name != companions.name() && std::ranges::find(kBeside, name) != kBeside.end();
    if (is_of_array || is_beside) names.push_back(name);
  }
  return names;
}

// --- Axes and places -----------------------------------------------------------------------------

struct ZarrAxis {
  std::string name = {};
  std::string type = {};
  std::string unit = {};
  std::string orientation = {};
};

std::vector<ZarrAxis> axes_of(const Json& scales, std::size_t count) {
  std::vector<ZarrAxis> axes;
  const Json& listed = at(scales, "axes");
  if (listed.is_null() && count == 5) {
    for (const char* name : {"t", "c", "z", "y", "x"}) axes.push_back({.name = name});
  }
  if (listed.is_array() && listed.size() <= ZarrArray::kMostAxes) {
    for (const Json& axis : listed) {
      if (axis.is_string()) axes.push_back({.name = word(axis)});
      if (!axis.is_object()) continue;
      axes.push_back({word(at(axis, "name")), word(at(axis, "type")), word(at(axis, "unit")),
                      word(at(at(axis, "orientation"), "value"))});
    }
  }
  if (axes.size() != count) {
    throw_unusable("The OME-Zarr's metadata does not name the " + std::to_string(count) +
                   " axes of its array.");
  }
  return axes;
}

bool is_spatial(const ZarrAxis& axis) {
  if (!axis.type.empty()) return axis.type == "space";
  return axis.name == "x" || axis.name == "y" || axis.name == "z";
}

// The array's axes of x, y and z: the fastest of space is x, unless they have these names.
std::array<std::size_t, 3> spatial_axes(const std::vector<ZarrAxis>& axes) {
  std::vector<std::size_t> found;
  for (std::size_t axis = axes.size(); axis-- > 0;) {
    if (is_spatial(axes[axis])) found.push_back(axis);
  }
  if (found.size() != 3) {
    throw_unusable("The OME-Zarr has " + std::to_string(found.size()) +
                   " axes of space. A volume has three.");
  }
  std::array<std::size_t, 3> named = {found[0], found[1], found[2]};
  constexpr std::string_view kNames = "xyz";
  std::array<bool, 3> seen = {};
  for (const std::size_t axis : found) {
    const std::size_t place = axes[axis].name.size() == 1 ? kNames.find(axes[axis].name) : 3;
    if (place >= 3 || seen[place]) return {found[0], found[1], found[2]};
    seen[place] = true;
    named[place] = axis;
  }
  return named;
}

struct Line {
  std::vector<double> scale;
  std::vector<double> translation;
};

// The transformations of one list, on top of `line`.
void apply(const Json& transformations, Line& line) {
  if (!transformations.is_array()) return;
  for (const Json& each : transformations) {
    const std::string type = word(at(each, "type"));
    if (type == "identity") continue;
    const bool is_scale = type == "scale";
    const Json& numbers = at(each, type.c_str());
    if ((!is_scale && type != "translation") || !numbers.is_array() ||
        numbers.size() != line.scale.size()) {
      throw_unusable("The OME-Zarr's transformation " + in_quotes(type) +
                     " is not supported. A scale and a translation are.");
    }
    for (std::size_t axis = 0; axis < line.scale.size(); ++axis) {
      const double number = numbers[axis].is_number() ? numbers[axis].get<double>() : std::nan("");
      if (!std::isfinite(number)) throw_unusable("The OME-Zarr's scale or translation is damaged.");
      if (is_scale) line.scale[axis] *= number;
      line.translation[axis] =
          is_scale ? line.translation[axis] * number : line.translation[axis] + number;
    }
  }
}

double millimetres_of(const std::string& unit, std::vector<Note>& notes) {
  Geometry one;
  scale_to_millimetres(one, unit, notes);
  return one.spacing[0];
}

// The direction in which an axis grows, in LPS. Empty if the file does not say it.
std::optional<Vector3> direction_of(const std::string& orientation) {
  static const std::map<std::string, Vector3, std::less<>> kDirections = {
      {"right-to-left", {1, 0, 0}},         {"left-to-right", {-1, 0, 0}},
      {"anterior-to-posterior", {0, 1, 0}}, {"posterior-to-anterior", {0, -1, 0}},
      {"inferior-to-superior", {0, 0, 1}},  {"superior-to-inferior", {0, 0, -1}}};
  const auto found = kDirections.find(orientation);
  return found == kDirections.end() ? std::nullopt : std::optional(found->second);
}

void set_geometry(const Json& scales, const std::vector<ZarrAxis>& axes,
                  const std::array<std::size_t, 3>& spatial, SourceVolume& source) {
  Line line = {std::vector<double>(axes.size(), 1), std::vector<double>(axes.size(), 0)};
  apply(at(at(scales, "datasets")[0], "coordinateTransformations"), line);
  apply(at(scales, "coordinateTransformations"), line);
  Geometry& geometry = source.geometry;
  std::array<Vector3, 3> directions = {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
  bool is_placed = true;
  for (std::size_t each = 0; each < 3; ++each) {
    const auto direction = direction_of(axes[spatial[each]].orientation);
    if (direction) directions[each] = *direction;
    is_placed &= direction.has_value();
  }
  if (!is_placed) {
    directions = {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
    source.notes.push_back(lps_assumed("An OME-Zarr"));
  }
  geometry.origin = {0, 0, 0};
  bool has_units = true;
  for (std::size_t each = 0; each < 3; ++each) {
    const ZarrAxis& axis = axes[spatial[each]];
    has_units &= !axis.unit.empty();
    const double unit = millimetres_of(axis.unit, source.notes);
    geometry.spacing[each] = line.scale[spatial[each]] * unit;
    for (std::size_t row = 0; row < 3; ++row) {
      geometry.direction[row * 3 + each] = directions[each][row];
      geometry.origin[row] += directions[each][row] * line.translation[spatial[each]] * unit;
    }
  }
  if (!has_units) {
    source.notes.push_back(note_of(
        NoteCode::kUnitUnknown,
        "The OME-Zarr does not say the unit of its axes. One unit was read as one millimetre."));
  }
}

// --- Volumes -------------------------------------------------------------------------------------

// The places of a volume along the axes beyond space.
class Beyond {
 public:
  Beyond(const std::vector<ZarrAxis>& axes, const ZarrArray& array,
         const std::array<std::size_t, 3>& spatial)
      : shape_(array.shape) {
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      if (std::ranges::find(spatial, axis) != spatial.end()) continue;
      axes_.push_back(axis);
      sizes_.push_back(shape_[axis]);
      names_.push_back(axes[axis].name == "c" || axes[axis].type == "channel" ? "channel"
                       : axes[axis].name == "t" || axes[axis].type == "time"  ? "time"
                                                                              : axes[axis].name);
    }
  }

  std::uint64_t count() const {
    std::vector<std::uint64_t> sizes = {1, 1, 1};
    sizes.insert(sizes.end(), sizes_.begin(), sizes_.end());
    return volumes_beyond(sizes);
  }

  Difference difference() const {
    std::string what;
    for (std::size_t each = 0; each < names_.size(); ++each) {
      if (sizes_[each] > 1) what += (what.empty() ? "" : " and ") + printable(names_[each]);
    }
    return {.what = what, .title = [*this](std::uint64_t index) { return title(index); }};
  }

  void set(std::uint64_t index, std::vector<std::uint64_t>& place) const {
    for (std::size_t each = axes_.size(); each-- > 0;) {
      place[axes_[each]] = index % sizes_[each];
      index /= sizes_[each];
    }
  }

 private:
  std::string title(std::uint64_t index) const {
    std::vector<std::uint64_t> place(shape_.size());
    set(index, place);
    std::string text;
    for (std::size_t each = 0; each < names_.size(); ++each) {
      if (sizes_[each] == 1) continue;
      text += (text.empty() ? "" : ", ") + printable(names_[each]) + ' ' +
              std::to_string(place[axes_[each]]);
    }
    return text;
  }

  std::vector<std::uint64_t> shape_;
  std::vector<std::size_t> axes_;
  std::vector<std::uint64_t> sizes_;
  std::vector<std::string> names_;
};

// Copies chunks to their places among the samples of a volume, x fastest.
class ChunkWriter {
 public:
  ChunkWriter(const ZarrArray& array, const std::array<std::size_t, 3>& spatial,
              std::span<std::byte> samples)
      : array_(array), spatial_(spatial), samples_(samples), bytes_(array.fill.size()) {
    strides_.resize(array.chunk.size());
    std::uint64_t stride = 1;
    for (std::size_t each = array.order.size(); each-- > 0;) {
      strides_[array.order[each]] = stride;
      stride *= array.chunk[array.order[each]];
    }
  }

  // `place` is the first sample of the chunk within the volume's; `chunk` is empty if it is
  // missing.
  void write(const std::vector<std::uint64_t>& place, std::span<const std::byte> chunk) const {
    std::uint64_t first = 0;
    for (std::size_t axis = 0; axis < place.size(); ++axis) {
      first += place[axis] % array_.chunk[axis] * strides_[axis];
    }
    const auto count = [&](std::size_t each) {
      const std::size_t axis = spatial_[each];
      return std::min(array_.chunk[axis], array_.shape[axis] - place[axis]);
    };
    for (std::uint64_t z = 0; z < count(2); ++z) {
      for (std::uint64_t y = 0; y < count(1); ++y) {
        const std::uint64_t row =
            ((place[spatial_[2]] + z) * array_.shape[spatial_[1]] + place[spatial_[1]] + y) *
                array_.shape[spatial_[0]] +
            place[spatial_[0]];
        const std::uint64_t from = first + z * strides_[spatial_[2]] + y * strides_[spatial_[1]];
        write_row(row, chunk, from, count(0));
      }
    }
  }

 private:
  void write_row(std::uint64_t row, std::span<const std::byte> chunk, std::uint64_t from,
                 std::uint64_t count) const {
    std::byte* target = samples_.data() + row * bytes_;
    const std::uint64_t stride = strides_[spatial_[0]];
    if (!chunk.empty() && stride == 1) {
      std::memcpy(target, chunk.data() + from * bytes_, count * bytes_);
      return;
    }
    for (std::uint64_t x = 0; x < count; ++x) {
      const std::byte* source =
          chunk.empty() ? array_.fill.data() : chunk.data() + (from + x * stride) * bytes_;
      std::memcpy(target + x * bytes_, source, bytes_);
    }
  }

  const ZarrArray& array_;
  std::array<std::size_t, 3> spatial_;
  std::span<std::byte> samples_;
  std::size_t bytes_;                   // of a sample
  std::vector<std::uint64_t> strides_;  // of the axes in a chunk, in samples
};

void write_chunks(const ZarrArray& array, const std::string& path,
                  const std::array<std::size_t, 3>& spatial, std::vector<std::uint64_t> place,
                  const Companions& companions, std::span<std::byte> samples) {
  std::array<std::uint64_t, 3> counts = {};
  std::uint64_t all = 1;
  for (std::size_t each = 0; each < 3; ++each) {
    const std::size_t axis = spatial[each];
    counts[each] = (array.shape[axis] + array.chunk[axis] - 1) / array.chunk[axis];
    if (counts[each] > kMostChunks / all) {
      throw_unusable("The OME-Zarr has more than a million chunks for a volume.");
    }
    all *= counts[each];
  }
  const ChunkWriter writer(array, spatial, samples);
  std::uint64_t found = 0;
  for (std::uint64_t next = 0; next < all; ++next) {
    std::uint64_t rest = next;
    for (std::size_t each = 0; each < 3; ++each) {
      place[spatial[each]] = rest % counts[each] * array.chunk[spatial[each]];
      rest /= counts[each];
    }
    std::vector<std::uint64_t> index(place.size());
    for (std::size_t axis = 0; axis < place.size(); ++axis) {
      index[axis] = place[axis] / array.chunk[axis];
    }
    const std::filesystem::path* file = companions.find(path + "/" + array.name_of(index));
    writer.write(place, file == nullptr ? std::vector<std::byte>() : decode_chunk(array, *file));
    found += file != nullptr ? 1 : 0;
  }
  if (found > 0) return;
  throw_unusable("The OME-Zarr has no chunk of " + in_quotes(path) +
                 ". Upload the whole folder with the hidden files, or a ZIP of it.");
}

// --- Labels --------------------------------------------------------------------------------------

LabelEntry& entry_for(std::int64_t label, std::map<std::int64_t, LabelEntry>& entries) {
  LabelEntry& entry = entries[label];
  entry.label = label;
  return entry;
}

// Names and colours of `image-label`; its values are labels even without them.
void set_labels(const Json& group, SourceVolume& source) {
  const Json& described = at(ome_of(group), "image-label");
  if (!described.is_object()) return;
  source.are_labels = true;
  std::map<std::int64_t, LabelEntry> entries;
  const auto for_each = [&](const char* list, const auto& use) {
    const Json& items = at(described, list);
    if (!items.is_array() || items.size() > Volume::kMostLabels) return;
    for (const Json& item : items) {
      const Json& value = at(item, "label-value");
      if (!value.is_number_integer() || value.get<std::int64_t>() == 0) continue;
      use(item, entry_for(value.get<std::int64_t>(), entries));
    }
  };
  for_each("colors", [](const Json& item, LabelEntry& entry) {
    const Json& rgba = at(item, "rgba");
    if (!rgba.is_array() || rgba.size() < 3) return;
    std::array<double, 3> color = {};
    for (std::size_t part = 0; part < 3; ++part) {
      if (!rgba[part].is_number_unsigned()) return;
      color[part] = rgba[part].get<double>() / 255;
    }
    entry.color = label_color(color);
  });
  for_each("properties", [](const Json& item, LabelEntry& entry) {
    for (const char* name : {"name", "label", "class"}) {
      if (entry.name.empty()) entry.name = label_name(word(at(item, name)));
    }
  });
  std::vector<LabelEntry> labels;
  for (auto& [label, entry] : entries) labels.push_back(std::move(entry));
  source.labels = label_table(std::move(labels));
}

// --- Reading -------------------------------------------------------------------------------------

ZarrArray array_of(const std::string& path, const Companions& companions) {
  const std::filesystem::path* metadata = companions.find(path + "/.zarray");
  if (metadata == nullptr) metadata = companions.find(path + "/zarr.json");
  if (metadata != nullptr) return zarr_array(zarr_json(*metadata));
  throw_unusable("The OME-Zarr's array " + in_quotes(path) +
                 " is missing. Upload the whole folder with the hidden files, or a ZIP of it.");
}

// A type of canonical files of the same size.
SampleType carrier_of(StoredType type) {
  switch (bytes_per_sample(type)) {
    case 1:
      return SampleType::kUint8;
    case 2:
      return SampleType::kUint16;
    case 4:
      return SampleType::kUint32;
    default:
      return SampleType::kFloat64;
  }
}

Volume parse_zarr(const Input& input) {
  const Json group = zarr_json(input.path);
  const Json& scales = scales_of(group);
  const std::string path = dataset_paths(scales).front();
  const ZarrArray array = array_of(path, input.companions);
  const std::vector<ZarrAxis> axes = axes_of(scales, array.shape.size());
  const std::array<std::size_t, 3> spatial = spatial_axes(axes);
  SourceVolume source;
  source.dims = volume_dims(std::array<std::uint64_t, 3>{
      array.shape[spatial[0]], array.shape[spatial[1]], array.shape[spatial[2]]});
  refuse_flat("The OME-Zarr", source.dims);
  source.layout.type = array.type;
  check_limits(source, input.task.limits);
  const Beyond beyond(axes, array, spatial);
  choose_volume(beyond.count(), beyond.difference(), input.task.options, source);
  std::vector<std::uint64_t> place(array.shape.size());
  beyond.set(source.chosen.index, place);
  source.chosen = {};
  set_geometry(scales, axes, spatial, source);
  set_labels(group, source);
  ScratchFile scratch(input.task.scratch, ".zarr");
  {
    // Mapped, because chunks come in any order.
    CanonicalWriter samples(scratch.path(), {source.dims, carrier_of(array.type), {}});
    write_chunks(array, path, spatial, std::move(place), input.companions, samples.samples());
  }
  const InputFile file(scratch.path());
  source.payload = range_from(file, volume::kHeaderBytes);
  return write_canonical(file, source, input.task);
}

MostBytes most_zarr_bytes(const InputFile& /*beginning*/, const ImportTask& task) {
  return {.file = kMostZarrHeaderBytes, .data = task.limits.max_sample_bytes + kHeadroomBytes};
}

}  // namespace

constinit const Reader kZarrReader = {.name = "zarr",
                                      .sniff = is_zarr,
                                      .parse = parse_zarr,
                                      .most_bytes = most_zarr_bytes,
                                      .data_names = zarr_data_names};

}  // namespace isomesh::import
