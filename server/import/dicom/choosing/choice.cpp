#include "server/import/dicom/choosing/choice.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "proto/notes.h"
#include "server/import/dicom/choosing/volumes.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/stack.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/dicom/kinds/segmentation.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

std::map<std::string_view, std::size_t> slices_by_uid(std::span<const Slice> slices) {
  std::map<std::string_view, std::size_t> counts;
  for (const Slice& slice : slices) ++counts[slice.image->frame_of_reference_uid];
  return counts;
}

// Positions refer to a frame of reference, which all slices of a volume share. Some anonymisers
// give each slice a different one, or none. Then the only evidence is that the slices lie evenly
// spaced on one line, which the caller has checked. This suffices if every slice has a different
// frame of reference or none; a note reports it. Groups of slices may come from several coordinate
// systems and are rejected unless `options` accept them.
std::optional<Note> note_on_frames_of_reference(std::span<const Slice> slices,
                                                const ImportOptions& options) {
  const auto counts = slices_by_uid(slices);
  if (counts.size() == 1) return std::nullopt;
  const bool one_each = std::ranges::all_of(
      counts, [](const auto& entry) { return entry.first.empty() || entry.second == 1; });
  const std::size_t several = counts.size() - counts.count("");
  const std::string found = "the " + std::to_string(slices.size()) + " slices have " +
                            std::to_string(several) + " frames of reference (0020,0052)" +
                            (counts.contains("") ? ", and some have none." : ".");
  const std::string even_line =
      " The slices are evenly spaced on one line, so they were read as one volume.";
  if (one_each) {
    return note_of(NoteCode::kFrameOfReference,
                   "Each slice has its own frame of reference, as some anonymisers write it: " +
                       found + even_line);
  }
  if (options.accepts(NoteCode::kFrameOfReference)) {
    return note_of(NoteCode::kFrameOfReference,
                   "The request accepts several frames of reference: " + found + even_line);
  }
  const auto other = std::ranges::find_if(slices, [&](const Slice& slice) {
    return slice.image->frame_of_reference_uid != slices.front().image->frame_of_reference_uid;
  });
  throw_overridable(
      NoteCode::kFrameOfReference,
      "The series is not a single volume: " + found +
          " Slices with different frames of reference may not share one coordinate system. For "
          "example, " +
          place_of(slices.front()) + " differs from " + place_of(*other) + "." +
          begin_remedy(options, "Add") + "accept=frame-of-reference to read them as one volume.");
}

// "0 (EchoTime 4.92, 20 slices); 1 (...); ..."
std::string listed(const std::vector<Choice>& choices) {
  constexpr std::size_t kMostNamed = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(choices.size(), kMostNamed); ++i) {
    text += (i == 0 ? "" : "; ") + choices[i].value + " (" + choices[i].title + ')';
  }
  return text + (choices.size() > kMostNamed ? "; ..." : "");
}

std::vector<Choice> choices_of(const SeriesVolumes& all) {
  std::vector<Choice> choices;
  for (const SeriesVolume& volume : all.volumes) {
    choices.push_back({"volume", std::to_string(choices.size()), volume.title});
  }
  return choices;
}

// The volume selected by the options. A single volume needs no selection.
std::vector<Slice> chosen_of(SeriesVolumes all, const ImportOptions& options,
                             std::vector<Note>& notes) {
  const std::size_t count = all.volumes.size();
  if (count == 1 && options.volume.value_or(0) == 0) return std::move(all.volumes.front().slices);
  const std::string difference = all.difference.empty() ? "" : " that differ in " + all.difference;
  const std::string found = "The series holds " + count_of(count, "volume") + difference + '.';
  std::vector<Choice> choices = choices_of(all);
  const std::string choose =
      begin_remedy(options, "Choose one with") + "volume=N: " + listed(choices) + '.';
  if (!options.volume) {
    throw_choice(found + choose, choices);
  }
  if (*options.volume >= count) {
    throw_choice(found + " It has no volume " + std::to_string(*options.volume) + '.' + choose,
                 choices);
  }
  SeriesVolume& chosen = all.volumes[*options.volume];
  if (chosen.whole_count > 0) {
    throw_choice("Volume " + std::to_string(*options.volume) +
                     " of the series is incomplete: it has " +
                     std::to_string(chosen.slices.size()) + " of " +
                     count_of(chosen.whole_count, "slice") + '.',
                 choices);
  }
  notes.push_back(note_of(NoteCode::kVolumeChosen, "Volume " + std::to_string(*options.volume) +
                                                       " of " + count_of(count, "volume") +
                                                       difference +
                                                       " was read. The first is volume 0."));
  return std::move(chosen.slices);
}

bool is_label_slice(const Slice& slice) { return slice.image->segmentation.has_value(); }

SeriesVolumes one_an_object(const std::vector<Slice>& slices) {
  SeriesVolumes all = {"their objects", {}};
  std::size_t last = 0;
  for (const Slice& slice : slices) {
    if (all.volumes.empty() || slice.file != last) all.volumes.push_back({});
    last = slice.file;
    all.volumes.back().slices.push_back(slice);
  }
  for (SeriesVolume& volume : all.volumes) {
    const Image& image = *volume.slices.front().image;
    volume.title = image.file_name.empty() ? "" : in_quotes(image.file_name) + ", ";
    volume.title += count_of(image.segmentation->segments.size(), "segment");
  }
  return all;
}

SeriesVolumes one_a_segment(const std::vector<Slice>& slices) {
  SeriesVolumes all = {"their segments", {}};
  const Image& image = *slices.front().image;
  for (const Segment& segment : image.segmentation->segments) {
    SeriesVolume volume = {segment_name(image, segment.number), {}, 0};
    std::ranges::copy_if(slices, std::back_inserter(volume.slices), [&](const Slice& slice) {
      return slice.frame->segment == segment.number;
    });
    all.volumes.push_back(std::move(volume));
  }
  return all;
}

// "(0, 0, 1)", with three decimals.
std::string in_words(const Vector3& direction) {
  std::string text;
  for (const double part : direction) {
    text += (text.empty() ? "(" : ", ") + to_text(std::round(part * 1000) / 1000 + 0.0);
  }
  return text + ')';
}

// Throws unless the options accept that frames without positions follow along the normal.
void note_distance(const Stack& stack, const ImportOptions& options, std::vector<Note>& notes) {
  const Image& image = *stack.slices.front().image;
  if (image.has_one_position) {
    const Plane& plane = image.frames.front().plane;
    const Vector3 normal = cross(plane.along_row, plane.along_column);
    const Vector3 step =
        difference(image.frames.back().plane.position, image.frames.front().plane.position);
    const bool is_backwards = dot(step, normal) < 0;
    std::string found = "The DICOM image has " + std::to_string(image.frames.size()) +
                        " frames, but no position for each of them.";
    if (image.may_be_times) {
      found += " They may be one slice at several times, not slices of a volume: their order " +
               tag_name(kFrameIncrementPointer) + " is that of time.";
    }
    const std::string how =
        in_mm(stack.geometry.spacing[2]) + " apart, as the " +
        (image.is_distance_assumed ? "slice thickness " + tag_name(kSliceThickness)
                                   : "spacing between slices " + tag_name(kSpacingBetweenSlices)) +
        " says, by ascending frame number along " +
        in_words(is_backwards ? moved({}, normal, -1) : normal) + '.';
    if (!options.accepts(NoteCode::kDistanceAssumed)) {
      throw_overridable(
          NoteCode::kDistanceAssumed,
          (image.file_name.empty() ? "" : "File " + in_quotes(image.file_name) + ": ") + found +
              begin_remedy(options, "Add") + "accept=distance-assumed to place the frames " + how);
    }
    notes.push_back(note_of(NoteCode::kDistanceAssumed, found + " The request places them " + how));
    return;
  }
  if (!stack.is_distance_assumed) return;
  notes.push_back(note_of(NoteCode::kDistanceAssumed,
                          "The distance between the slices is unknown. The slice thickness, " +
                              in_mm(stack.geometry.spacing[2]) + ", was used."));
}

// Throws if the directions of rows and columns had to be corrected by more than rounding explains,
// unless the options accept it.
void note_directions(const Stack& stack, const ImportOptions& options, std::vector<Note>& notes) {
  constexpr double kSmallSkew = 1;  // degrees
  constexpr double kSmallStretch = 0.02;
  double skew = 0;
  double stretch = 0;
  const Slice* worst = &stack.slices.front();
  for (const Slice& slice : stack.slices) {
    const Plane& plane = slice.frame->plane;
    if (plane.skew > skew || plane.stretch > stretch) worst = &slice;
    skew = std::max(skew, plane.skew);
    stretch = std::max(stretch, plane.stretch);
  }
  if (skew == 0 && stretch == 0) return;
  std::string found;
  if (skew > 0) {
    found = "The directions of rows and columns are " + to_text(std::round(skew * 100) / 100) +
            " degrees away from perpendicular.";
  }
  if (stretch > 0) {
    found += (found.empty() ? "" : " ") +
             std::string(
                 "The lengths of the directions of rows and "
                 "columns differ from 1 by up to ") +
             to_text(std::round(stretch * 1000) / 1000) + '.';
  }
  if ((skew > kSmallSkew || stretch > kSmallStretch) &&
      !options.accepts(NoteCode::kDirectionsCorrected)) {
    throw_overridable(
        NoteCode::kDirectionsCorrected,
        found + (place_of(*worst).empty() ? "" : " So it is in " + place_of(*worst) + ".") +
            begin_remedy(options, "Add") +
            "accept=directions-corrected to use the nearest perpendicular ones.");
  }
  notes.push_back(note_of(NoteCode::kDirectionsCorrected,
                          found + " The nearest perpendicular unit vectors were used."));
}

// Planes without a frame have no label.
void note_empty_planes(const Stack& stack, std::vector<Note>& notes) {
  std::uint32_t filled = 0;
  for (std::size_t i = 0; i < stack.planes.size(); ++i) {
    if (i == 0 || stack.planes[i] != stack.planes[i - 1]) ++filled;
  }
  if (filled == stack.plane_count) return;
  notes.push_back(
      note_of(NoteCode::kEmptyPlanes, std::to_string(stack.plane_count - filled) + " of the " +
                                          std::to_string(stack.plane_count) +
                                          " planes have no frame. Their samples are 0."));
}

std::vector<Slice> choose_label_slices(std::vector<Slice> slices, const ImportOptions& options,
                                       std::vector<Note>& notes) {
  SeriesVolumes objects = one_an_object(slices);
  if (objects.volumes.size() > 1) return chosen_of(std::move(objects), options, notes);
  if (!options.volume || slices.front().image->segmentation->kind == SegmentKind::kLabelMap) {
    return chosen_of({"", {{"", std::move(slices), 0}}}, options, notes);
  }
  std::vector<Slice> chosen = chosen_of(one_a_segment(slices), options, notes);
  if (chosen.empty()) throw_unusable("The segmentation has no frames of the chosen segment.");
  return chosen;
}

Stack choose_labels(std::vector<Slice> slices, const ImportOptions& options,
                    std::vector<Note>& notes) {
  Stack stack = make_label_stack(choose_label_slices(std::move(slices), options, notes), options);
  note_distance(stack, options, notes);
  note_directions(stack, options, notes);
  note_empty_planes(stack, notes);
  return stack;
}

bool has_changed_values(const Slice& slice) {
  const Rescale& rescale = slice.frame->rescale;
  return slice.image->value_mappings > 0 && (rescale.slope != 1 || rescale.intercept != 0);
}

void note_mappings(const Stack& stack, std::vector<Note>& notes) {
  std::uint32_t mappings = 0;
  for (const Slice& slice : stack.slices) {
    mappings = std::max(mappings, slice.image->value_mappings);
  }
  std::string detail;
  if (std::ranges::any_of(stack.slices, has_changed_values)) {
    detail =
        "The samples were changed by the slope and intercept of the parametric map's real world "
        "values. Programs that ignore these show other values.";
  }
  if (mappings > 1) {
    detail += (detail.empty() ? "" : " ") + std::string("The parametric map has ") +
              std::to_string(mappings) +
              " mappings to real world values. The first one that applies to all samples was used.";
  }
  if (!detail.empty()) notes.push_back(note_of(NoteCode::kValuesRescaled, std::move(detail)));
}

// Throws unless the options accept that a volume's place in the patient is unknown.
void note_place(const Stack& stack, const ImportOptions& options, std::vector<Note>& notes) {
  const PlaceKind place = stack.slices.front().image->place;
  if (place == PlaceKind::kVolume) {
    notes.push_back(note_of(NoteCode::kSpaceAssumed,
                            "The positions of the DICOM frames are relative to the transducer, not "
                            "to the patient. They were read as if they were in the patient."));
  }
  if (place != PlaceKind::kAssumed) return;
  if (!options.accepts(NoteCode::kSpaceAssumed)) {
    throw_overridable(NoteCode::kSpaceAssumed,
                      "The DICOM tomogram does not define its position and orientation, so its "
                      "place in the patient is unknown." +
                          begin_remedy(options, "Add") +
                          "accept=space-assumed to place its first slice at the origin.");
  }
  notes.push_back(note_of(NoteCode::kSpaceAssumed,
                          "The DICOM tomogram does not define its position and orientation. Its "
                          "first slice was placed at the origin, and rows and columns without an "
                          "orientation along the patient's x and y."));
}

// The distance between slices of a file that has none.
double told_distance(const Stack& stack, const ImportOptions& options) {
  if (options.spacing) return (*options.spacing)[2];
  const auto& [across, down] = stack.slices.front().frame->plane.spacing;
  throw_choice("The DICOM tomogram does not declare the distance between its slices " +
                   tag_name(kSpacingBetweenSlices) + " nor their thickness " +
                   tag_name(kSliceThickness) + '.' + begin_remedy(options, "Add") +
                   "spacing=X,Y,Z (mm); Z is the distance, and X and Y are not used.",
               {{"spacing", to_text(across) + ',' + to_text(down) + ",1", "a distance of 1 mm"}});
}

}  // namespace

Stack choose_stack(std::vector<Slice> slices, const SameSamples& same_samples,
                   const ImportOptions& options, std::vector<Note>& notes) {
  if (std::ranges::all_of(slices, is_label_slice)) {
    return choose_labels(std::move(slices), options, notes);
  }
  if (std::ranges::any_of(slices, is_label_slice)) {
    throw_unusable("The series is not a single volume: it mixes images and segmentations.");
  }
  const bool is_unknown = std::ranges::any_of(
      slices, [](const Slice& slice) { return slice.image->is_distance_unknown; });
  if (!is_unknown) refuse_spacing(options);
  DistinctSlices distinct = without_duplicates(
      chosen_of(split_volumes(std::move(slices)), options, notes), same_samples, options, notes);
  Stack stack = make_stack(std::move(distinct.slices), options, notes);
  stack.left_out = std::move(distinct.left_out);
  if (is_unknown) stack.geometry.spacing[2] = told_distance(stack, options);
  note_distance(stack, options, notes);
  note_directions(stack, options, notes);
  note_mappings(stack, notes);
  note_place(stack, options, notes);
  if (auto note = note_on_frames_of_reference(stack.slices, options)) {
    notes.push_back(std::move(*note));
  }
  return stack;
}

}  // namespace isomesh::import::dicom
