#include "server/import/dicom/import.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/error.h"
#include "proto/presets.h"
#include "server/import/dicom/choosing/choice.h"
#include "server/import/dicom/choosing/series.h"
#include "server/import/dicom/choosing/series_facts.h"
#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/kinds/segmentation.h"
#include "server/import/dicom/pixels/padding.h"
#include "server/import/dicom/pixels/pixels.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/dicom/structures.h"
#include "server/import/labels/closed_ends.h"
#include "server/import/samples/padding.h"
#include "server/import/samples/transfer.h"
#include "server/import/source/ct_presets.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace dicom {
namespace {

// Keeps the file of the last slice open, because it often holds the next slice too.
class OpenFile {
 public:
  OpenFile(std::span<const Source> sources, std::filesystem::path scratch,
           std::uint64_t most_sample_bytes)
      : sources_(sources), scratch_(std::move(scratch)), most_sample_bytes_(most_sample_bytes) {}

  FrameReader& reader(std::size_t index) {
    if (!file_ || index_ != index) {
      reader_.reset();
      file_.emplace(sources_[index].file.path, scratch_, most_sample_bytes_);
      reader_.emplace(*file_, sources_[index].image);
      index_ = index;
    }
    return *reader_;
  }

  const DataSet& data() const { return file_->data(); }

 private:
  std::span<const Source> sources_;
  std::filesystem::path scratch_;
  std::uint64_t most_sample_bytes_;
  std::size_t index_ = 0;
  std::optional<DicomFile> file_;
  std::optional<FrameReader> reader_;
};

std::vector<Slice> slices_of(std::span<const Source> sources) {
  std::vector<Slice> slices;
  for (std::size_t file = 0; file < sources.size(); ++file) {
    const Image& image = sources[file].image;
    for (const Frame& frame : image.frames) slices.push_back({&image, &frame, file});
  }
  return slices;
}

bool are_labels(const Stack& stack) { return stack.plane_count > 0; }

// `name` is the slice's in messages.
void read_slice(const Slice& slice, const std::string& name, OpenFile& file,
                std::span<std::byte> stored, const SeeStored& see = {}) {
  try {
    file.reader(slice.file).read(slice.frame->number, stored, see);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    throw_unusable("The DICOM image cannot be read: " + name + ": " + error.what() + '.');
  }
}

void read_slice(const Stack& stack, std::size_t place, OpenFile& file, std::span<std::byte> stored,
                const SeeStored& see = {}) {
  const Slice& slice = stack.slices[place];
  const std::string& name = slice.image->file_name;
  read_slice(slice, stack.name(place) + (name.empty() ? "" : " (" + in_quotes(name) + ')'), file,
             stored, see);
}

bool have_same_samples(const Slice& one, const Slice& other, OpenFile& file, OpenFile& other_file) {
  const Rescale& rescale = one.frame->rescale;
  const Rescale& its = other.frame->rescale;
  if (one.image->layout != other.image->layout || rescale.slope != its.slope ||
      rescale.intercept != its.intercept) {
    return false;
  }
  std::vector<std::byte> samples(one.image->layout.frame_bytes());
  std::vector<std::byte> others(samples.size());
  read_slice(one, place_of(one), file, samples);
  read_slice(other, place_of(other), other_file, others);
  return samples == others;
}

Stack stack_of(std::span<const Source> sources, const ImportTask& task,
               const ImportOptions& options, std::vector<Note>& notes) {
  // Two, because the slices of two files may be compared in turns.
  OpenFile file(sources, task.scratch, task.limits.max_sample_bytes);
  OpenFile other_file(sources, task.scratch, task.limits.max_sample_bytes);
  const auto same_samples = [&](const Slice& one, const Slice& other) {
    return have_same_samples(one, other, file, other_file);
  };
  return choose_stack(slices_of(sources), same_samples, options, notes);
}

// The files of which no slice is used.
void ignore_left_out(const Stack& stack, std::span<const Source> sources, Upload& upload) {
  for (const Slice& slice : stack.left_out) {
    if (slice.image->frames.size() > 1) continue;
    ignore(upload, sources[slice.file].file, "its slice lies at the position of another one");
  }
}

// Returns false if a sample does not fit into the type.
bool write_samples(const Stack& stack, SampleType type, OpenFile& file, std::span<std::byte> target,
                   SampleSet& padding) {
  std::uint64_t first = 0;
  std::vector<std::byte> stored;
  for (std::size_t place = 0; place < stack.slices.size(); ++place) {
    const Slice& slice = stack.slices[place];
    const PixelLayout& layout = slice.image->layout;
    stored.resize(layout.frame_bytes());
    const auto see = [&](std::span<const std::byte> values, const PixelLayout& of_values) {
      const auto& range = slice.image->padding;
      if (range) find_padding(*range, of_values, values, first, padding);
    };
    read_slice(stack, place, file, stored, see);
    first += layout.samples();
    const std::span<std::byte> plane = target.first(layout.samples() * bytes_per_sample(type));
    if (!convert_frame(stored, layout, slice.frame->rescale, type, plane)) return false;
    target = target.subspan(plane.size());
  }
  return true;
}

// Returns empty if a value does not fit into the type.
std::optional<Volume> write_image(const Stack& stack, Volume volume, OpenFile& file,
                                  const ImportTask& task) {
  CanonicalWriter writer(task.target, {volume.dims, volume.type, volume.geometry});
  SampleSet padding(volume.sample_count());
  if (!write_samples(stack, volume.type, file, writer.samples(), padding)) return std::nullopt;
  const std::uint64_t left_out =
      padding.is_empty() ? 0 : leave_out_padding(padding, task.options, writer.samples(), volume);
  return finish(writer, std::move(volume), {.left_out = left_out});
}

// As write_image, with the labels found in the samples.
std::optional<Volume> write_segments(const Stack& stack, Volume volume, OpenFile& file,
                                     const ImportTask& task) {
  const auto read = [&](std::size_t place, std::span<std::byte> stored) {
    read_slice(stack, place, file, stored);
  };
  CanonicalWriter writer(task.target, {with_room(volume.dims, volume.type, task.limits),
                                       volume.type, volume.geometry});
  const std::span<std::byte> samples =
      writer.samples().first(volume.sample_count() * bytes_per_sample(volume.type));
  if (!write_labels(stack, volume.type, read, samples, volume)) return std::nullopt;
  close_ends(writer, volume);
  return finish(writer, std::move(volume));
}

Volume write_volume(const Stack& stack, Volume volume, OpenFile& file, const ImportTask& task) {
  if (!are_labels(stack)) refuse_flat("The series", volume.dims);
  // Decode one slice before the disk space is allocated: a small stream may declare any number of
  // rows.
  std::vector<std::byte> first(stack.slices.front().image->layout.frame_bytes());
  read_slice(stack, 0, file, first);
  const std::vector<SampleType> types =
      are_labels(stack) ? label_types(stack) : candidate_types(stack.slices);
  for (const SampleType type : types) {
    check_limits(volume.sample_count(), type, task.limits);
    volume.type = type;
    auto written = are_labels(stack) ? write_segments(stack, volume, file, task)
                                     : write_image(stack, volume, file, task);
    if (written) return std::move(*written);
  }
  throw Error(ErrorCode::kInternal, "No sample type can hold the samples of a DICOM volume.");
}

Volume describe_volume(const Stack& stack) {
  const Image& image = *stack.slices.front().image;
  Volume volume;
  volume.format = "dicom";
  volume.dims = {image.layout.columns, image.layout.rows, stack.depth()};
  volume.geometry = normalised(stack.geometry);
  if (const auto fault = find_fault(volume.dims, volume.geometry)) {
    throw_unusable("The geometry of the series cannot be used: " + fault->message + ".");
  }
  if (!image.modality.empty()) volume.modality = image.modality;
  return volume;
}

// Some files lack the rescale that every CT must have, and have the numbers of the detector.
bool is_in_hounsfield_units(const Stack& stack, const Volume& volume) {
  const Image& image = *stack.slices.front().image;
  if (image.modality != "CT") return false;
  if (!image.rescale_type.empty()) return image.rescale_type == "HU";
  return stack.slices.front().frame->has_intercept || volume.range[0] < 0;
}

// Adds the presets whose values occur. They may be better than a value derived from the samples.
void suggest(const Stack& stack, Volume& volume) {
  if (is_in_hounsfield_units(stack, volume)) add_ct_presets(volume);
  if (!are_labels(stack) || !are_shares(stack)) return;
  volume.suggested_iso = half_of(stack);
  // Half of a share is inside of a part that was cut out, too.
  if (volume.suggested_iso > volume.range[1]) return;
  const auto* const row =
      std::ranges::find(kPresets, std::optional<double>(), &PresetRow::hounsfield);
  volume.presets.push_back({std::string(row->name), volume.suggested_iso});
}

// Notes of one code are one note.
void add_note(Note note, Volume& volume) {
  const auto known = std::ranges::find(volume.notes, note.code, &Note::code);
  if (known == volume.notes.end()) {
    volume.notes.push_back(std::move(note));
  } else {
    known->detail = note.detail + ' ' + known->detail;
  }
}

DicomIdentity identify(const Stack& stack, std::span<const Source> sources, const DataSet& data) {
  DicomIdentity identity = identity_of(data);
  std::vector<bool> seen(sources.size());
  for (const Slice& slice : stack.slices) {
    if (!seen[slice.file]) identity.instances.push_back(sources[slice.file].instance);
    seen[slice.file] = true;
    // The volume has one only if all slices share it.
    if (slice.image->frame_of_reference_uid != stack.slices.front().image->frame_of_reference_uid) {
      identity.frame_of_reference_uid.clear();
    }
  }
  return identity;
}

bool is_on_geometry(const Note& note) {
  return std::ranges::any_of(
      std::array{NoteCode::kPositionsRounded, NoteCode::kDirectionsCorrected,
                 NoteCode::kDistanceAssumed, NoteCode::kFrameOfReference, NoteCode::kSpaceAssumed},
      [&](NoteCode code) { return note.code == describe(code).name; });
}

// The grid of the images that a structure set belongs to; empty if there are none. Adds the notes
// on its geometry.
std::optional<ContourGrid> grid_beside(const StructureFile& structures,
                                       const std::vector<Source>& all, const ImportTask& task,
                                       std::vector<Note>& geometry_notes) {
  ImportOptions options = task.options;
  const std::vector<Source> sources = images_of(structures, all);
  if (sources.empty() || options.spacing) return std::nullopt;
  // Several volumes of one series have the same grid, and `volume` selects a structure here.
  options.volume.reset();
  const auto grid = [&] {
    std::vector<Note> notes;
    const Stack stack = stack_of(sources, task, options, notes);
    std::ranges::copy_if(notes, std::back_inserter(geometry_notes), is_on_geometry);
    const PixelLayout& layout = stack.slices.front().image->layout;
    return ContourGrid{{layout.columns, layout.rows, stack.depth()}, stack.geometry};
  };
  try {
    return grid();
  } catch (const Error& error) {
    if (error.remedy().choices.empty()) throw;
    options.volume = 0;
    return grid();
  }
}

Volume import_upload(Upload& upload, const ImportTask& task) {
  if (const auto* structures = chosen_structures(upload, task.options.series)) {
    std::vector<Note> notes;
    const auto grid = grid_beside(*structures, upload.sources, task, notes);
    Volume volume = import_structures(structures->file.path, grid, task);
    for (Note& note : notes) add_note(std::move(note), volume);
    volume.ignored = std::move(upload.ignored);
    return volume;
  }
  const std::vector<Source> sources = choose_series(upload.sources, task.options.series);
  std::vector<Note> notes = std::move(upload.notes);
  OpenFile file(sources, task.scratch, task.limits.max_sample_bytes);
  const Stack stack = stack_of(sources, task, task.options, notes);
  ignore_left_out(stack, sources, upload);
  Volume volume = write_volume(stack, describe_volume(stack), file, task);
  suggest(stack, volume);
  volume.ignored = std::move(upload.ignored);
  for (Note& note : notes) add_note(std::move(note), volume);
  if (are_labels(stack)) {
    if (auto note = note_on_shares(stack)) volume.notes.push_back(std::move(*note));
  }
  volume.dicom = identify(stack, sources, file.data());
  if (!volume.dicom->series_description.empty()) volume.name = volume.dicom->series_description;
  return volume;
}

}  // namespace
}  // namespace dicom

bool is_dicom(std::string_view head) { return dicom::find_beginning(head).has_value(); }

Volume import_dicom(std::span<const NamedFile> files, const ImportTask& task) {
  const std::uint64_t most_sample_bytes = task.limits.max_sample_bytes;
  dicom::Upload upload = dicom::read_headers(files, task.scratch, most_sample_bytes);
  try {
    return dicom::import_upload(upload, task);
  } catch (const Error& error) {
    if (error.remedy().choices.empty()) throw;
    throw dicom::with_series_facts(error, upload.sources, task.scratch, most_sample_bytes);
  }
}

MostBytes most_dicom_bytes(const InputFile& beginning, const ImportTask& task) {
  return {.file = dicom::most_file_bytes(beginning, task.scratch, task.limits.max_sample_bytes)};
}

Volume parse_dicom(const Input& input) {
  const NamedFile file = named(input.path);
  return import_dicom({&file, 1}, input.task);
}

}  // namespace isomesh::import
