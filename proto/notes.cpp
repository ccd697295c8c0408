#include "proto/notes.h"

#include <algorithm>
#include <utility>

namespace isomesh {
namespace {

constexpr NoteDescription kNoteDescriptions[] = {
    {.code = NoteCode::kFormsDiffer,
     .name = "forms-differ",
     .meaning = "The sform and the qform of a NIfTI header place the samples differently; the "
                "detail says by how much, and which one was used.",
     .is_in_mesh = true},
    {.code = NoteCode::kPixdimDiffers,
     .name = "pixdim-differs",
     .meaning = "The voxel sizes of a NIfTI header differ from the lengths of the sform's steps; "
                "the sform was used.",
     .is_in_mesh = true},
    {.code = NoteCode::kVolumeChosen,
     .name = "volume-chosen",
     .meaning = "The file holds several volumes, and the request chose this one.",
     .is_in_mesh = true},
    {.code = NoteCode::kSpaceAssumed,
     .name = "space-assumed",
     .meaning = "The file does not say how its axes are oriented in the patient; the detail says "
                "what was assumed.",
     .is_in_mesh = true},
    {.code = NoteCode::kUnitUnknown,
     .name = "unit-unknown",
     .meaning = "The file's unit is not a length; one unit was taken as one millimetre.",
     .is_in_mesh = true},
    {.code = NoteCode::kNonFiniteSamples,
     .name = "non-finite-samples",
     .meaning = "Some samples are infinite or not a number; they got the value of the smallest "
                "sample and lie outside the surface.",
     .is_in_mesh = true},
    {.code = NoteCode::kTrailingBytes,
     .name = "trailing-bytes",
     .meaning = "The data is longer than the header says; the excess was ignored."},
    {.code = NoteCode::kValuesRescaled,
     .name = "values-rescaled",
     .meaning =
         "The samples were rescaled by the header's slope and offset, which other programs ignore.",
     .is_in_mesh = true},
    {.code = NoteCode::kDuplicateFile,
     .name = "duplicate-file",
     .meaning = "A file was sent more than once; one copy was used."},
    {.code = NoteCode::kLooksLikeLabels,
     .name = "looks-like-labels",
     .meaning = "The samples are labels: the file says so, or they are few whole values in flat "
                "regions. A job with `labels` gives each label its surface; an iso-value gives one "
                "surface of everything above it."},
    {.code = NoteCode::kFrameOfReference,
     .name = "frame-of-reference",
     .meaning = "The DICOM slices do not share one frame of reference; their positions were taken "
                "to be in one space.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kEmptyPlanes,
     .name = "empty-planes",
     .meaning = "A DICOM segmentation omits frames that show nothing; they became planes of zeros.",
     .is_in_mesh = true},
    {.code = NoteCode::kDistanceAssumed,
     .name = "distance-assumed",
     .meaning = "The DICOM image does not give the distance between its slices; the slice "
                "thickness was used.",
     .is_in_mesh = true},
    {.code = NoteCode::kOverlappingSegments,
     .name = "overlapping-segments",
     .meaning = "Segments overlap; a sample in several segments has a value that numbers their "
                "combination, and a label stands for all values that its segment is in.",
     .is_in_mesh = true},
    {.code = NoteCode::kFractionalSegments,
     .name = "fractional-segments",
     .meaning = "A DICOM segmentation holds fractions or probabilities; a segment is where they "
                "are half of their maximum or more.",
     .is_in_mesh = true},
};

}  // namespace

std::span<const NoteDescription> note_descriptions() { return kNoteDescriptions; }

const NoteDescription& describe(NoteCode code) {
  return *std::ranges::find(kNoteDescriptions, code, &NoteDescription::code);
}

const NoteDescription* find_note(std::string_view name) {
  const auto* found = std::ranges::find(kNoteDescriptions, name, &NoteDescription::name);
  return found == std::end(kNoteDescriptions) ? nullptr : found;
}

std::string acceptable_notes() {
  std::string names;
  for (const NoteDescription& row : kNoteDescriptions) {
    if (row.is_acceptable) names += (names.empty() ? "" : ", ") + std::string(row.name);
  }
  return names;
}

Note note_of(NoteCode code, std::string detail) {
  return {std::string(describe(code).name), std::move(detail)};
}

std::vector<Note> notes_in_mesh(const std::vector<Note>& notes) {
  std::vector<Note> chosen;
  std::ranges::copy_if(notes, std::back_inserter(chosen), [](const Note& note) {
    const NoteDescription* known = find_note(note.code);
    return known != nullptr && known->is_in_mesh;
  });
  return chosen;
}

}  // namespace isomesh
