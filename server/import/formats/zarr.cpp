#include <algorithm>
#include <array>
#include <cstring>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/zarr_array.h"
#include "server/import/formats/zarr_meaning.h"
#include "server/import/samples/transfer.h"

namespace isomesh::import {
namespace {

constexpr std::uint64_t kMostChunks = 1'000'000;  // of a volume
constexpr std::size_t kMostDatasets = 64;

// Looks for a group's own `multiscales` or `image-label`, also in the beginning of a file.
// Consolidated metadata repeat those of groups below it.
class OwnKeys : public nlohmann::json_sax<Json> {
 public:
  bool found() const { return found_; }

  bool start_object(std::size_t /*elements*/) override { return descend(true); }
  bool start_array(std::size_t /*elements*/) override { return descend(false); }
  bool end_object() override { return ascend(); }
  bool end_array() override { return ascend(); }

  bool key(string_t& name) override {
    if (path_.empty()) return false;
    path_.back() = name;
    const bool is_here =
        path_.size() == 1 || (path_.size() == 3 && path_[0] == "attributes" && path_[1] == "ome");
    found_ = is_here && (name == "multiscales" || name == "image-label");
    return !found_;
  }

  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool number_integer(number_integer_t /*value*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
  bool string(string_t& /*value*/) override { return true; }
  bool binary(binary_t& /*value*/) override { return true; }
  bool parse_error(std::size_t /*place*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*fault*/) override {
    return false;
  }

 private:
  bool descend(bool is_object) {
    if (path_.empty() && !is_object) return false;
    path_.emplace_back();
    return true;
  }

  bool ascend() {
    path_.pop_back();
    return true;
  }

  bool found_ = false;
  std::vector<std::string> path_;  // the keys of the open objects; empty for arrays
};

bool is_zarr(std::string_view head) {
  if (!trimmed(head.substr(0, 64)).starts_with('{')) return false;
  OwnKeys keys;
  read_json_events<Json>(head, keys);
  return keys.found();
}

std::vector<std::string> dataset_paths(const Json& scales) {
  std::vector<std::string> paths;
  const Json& datasets = zarr_member(scales, "datasets");
  if (!datasets.is_array()) return paths;
  for (const Json& dataset : datasets) {
    if (paths.size() < kMostDatasets) paths.push_back(zarr_text(zarr_member(dataset, "path")));
  }
  return paths;
}

const Json& scales_of(const Json& group) {
  const Json& scales = zarr_member(zarr_ome(group), "multiscales");
  if (!scales.is_array() || scales.empty() || dataset_paths(scales[0]).empty()) {
    throw_unusable("The OME-Zarr's metadata has no multiscales with datasets.");
  }
  return scales[0];
}

// Everything in the arrays' folders, and metadata that no note should list. Only the metadata of a
// group have them, so files of an archive are not asked for again and again.
std::vector<std::string> zarr_data_names(const InputFile& file, const Companions& companions) {
  if (companions.name() != ".zattrs" && companions.name() != "zarr.json") return {};
  const Json group = parse_json<Json>(file.text(0, kMostZarrHeaderBytes), nullptr, false);
  std::set<std::string> names;
  const std::vector<std::string> paths = dataset_paths(scales_of(group));
  for (const std::string& path : std::set(paths.begin(), paths.end())) {
    names.merge(companions.below(path));
  }
  for (const char* name : {".zgroup", ".zattrs", "labels/.zattrs", "labels/.zgroup",
                           "labels/zarr.json", "OME/METADATA.ome.xml"}) {
    if (companions.find(name) != nullptr) names.insert(name);
  }
  return {names.begin(), names.end()};
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
      : array_(array),
        spatial_(spatial),
        samples_(samples),
        bytes_(array.fill.size()),
        strides_(array.strides()) {}

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

using Counts = std::array<std::uint64_t, 3>;

// The chunks of a volume along x, y and z. Throws Error kUnusableVolume if they are far larger than
// the volume can be, because each is decoded as a whole.
Counts chunk_counts(const ZarrArray& array, const std::array<std::size_t, 3>& spatial,
                    const SizeLimits& limits) {
  constexpr std::uint64_t kMostPerByte = 4;
  Counts counts = {};
  std::uint64_t all = 1;
  for (std::size_t each = 0; each < 3; ++each) {
    const std::size_t axis = spatial[each];
    counts[each] = (array.shape[axis] + array.chunk[axis] - 1) / array.chunk[axis];
    if (counts[each] > kMostChunks / all) {
      throw_unusable("The OME-Zarr has more than a million chunks for a volume.");
    }
    all *= counts[each];
  }
  const std::uint64_t bytes = all * array.chunk_samples() * array.fill.size();
  if (all > 1 && bytes / kMostPerByte > limits.max_sample_bytes) {
    throw_unusable("The OME-Zarr's chunks hold " + std::to_string(bytes) +
                   " bytes for one volume, which is too many. Write it with chunks that do not "
                   "reach beyond a volume.");
  }
  return counts;
}

// Writes the volume that begins at `place`, with a note if chunks are missing.
void write_chunks(const ZarrArray& array, const std::string& path,
                  const std::array<std::size_t, 3>& spatial, std::vector<std::uint64_t> place,
                  const Counts& counts, const Companions& companions, std::span<std::byte> samples,
                  std::vector<Note>& notes) {
  const ChunkWriter writer(array, spatial, samples);
  const std::uint64_t all = counts[0] * counts[1] * counts[2];
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
  if (found == 0) {
    throw_unusable("The OME-Zarr has no chunk of " + in_quotes(path) +
                   ". Upload the whole folder with the hidden files, or a ZIP of it.");
  }
  if (found == all) return;
  notes.push_back(note_of(NoteCode::kChunksMissing,
                          std::to_string(all - found) + " of " + std::to_string(all) +
                              " chunks of the OME-Zarr are missing. Their samples have the fill "
                              "value. Some programs leave out chunks that have no other value."));
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
  const std::vector<ZarrAxis> axes = zarr_axes(scales, array.shape.size());
  const std::array<std::size_t, 3> spatial = zarr_spatial_axes(axes);
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
  set_zarr_geometry(scales, axes, spatial, source);
  set_zarr_labels(group, source);
  const Counts counts = chunk_counts(array, spatial, input.task.limits);
  ScratchFile scratch(input.task.scratch, ".zarr");
  {
    // Mapped, because chunks come in any order.
    CanonicalWriter samples(scratch.path(), {source.dims, carrier_of(array.type), {}});
    write_chunks(array, path, spatial, std::move(place), counts, input.companions,
                 samples.samples(), source.notes);
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
