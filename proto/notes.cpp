#include "proto/notes.h"

#include <algorithm>
#include <utility>

namespace isomesh {
namespace {

constexpr NoteDescription kNoteDescriptions[] = {
    {.code = NoteCode::kFormsDiffer,
     .name = "forms-differ",
     .meaning = "A NIfTI header's sform and qform place the samples differently; the detail says "
                "by how much and which was taken.",
     .is_in_mesh = true},
    {.code = NoteCode::kPixdimDiffers,
     .name = "pixdim-differs",
     .meaning = "A NIfTI header's voxel sizes are not the lengths of its sform's steps; the sform "
                "was taken.",
     .is_in_mesh = true},
    {.code = NoteCode::kVolumeChosen,
     .name = "volume-chosen",
     .meaning = "The file holds several volumes, of which the request chose this one.",
     .is_in_mesh = true},
    {.code = NoteCode::kSpaceAssumed,
     .name = "space-assumed",
     .meaning = "The file does not say how its axes lie in the patient; the detail says what was "
                "assumed.",
     .is_in_mesh = true},
    {.code = NoteCode::kUnitUnknown,
     .name = "unit-unknown",
     .meaning = "The file's unit is no length; one unit was taken for one millimetre.",
     .is_in_mesh = true},
    {.code = NoteCode::kNonFiniteSamples,
     .name = "non-finite-samples",
     .meaning = "Some samples are no numbers or infinite; they have the smallest sample's value "
                "and are outside of the surface.",
     .is_in_mesh = true},
    {.code = NoteCode::kTrailingBytes,
     .name = "trailing-bytes",
     .meaning = "The data is longer than the header tells; what is too much was left out."},
    {.code = NoteCode::kValuesRescaled,
     .name = "values-rescaled",
     .meaning = "The samples were changed by the header's slope and offset, which other programs "
                "pass over.",
     .is_in_mesh = true},
    {.code = NoteCode::kDuplicateFile,
     .name = "duplicate-file",
     .meaning = "A file came more than once and was taken once."},
    {.code = NoteCode::kLooksLikeLabels,
     .name = "looks-like-labels",
     .meaning = "The samples are labels, as the file says or as few whole values in flat regions "
                "look: a job's `labels` suits them, and an iso-value makes one surface of all that "
                "lie above it."},
    {.code = NoteCode::kFrameOfReference,
     .name = "frame-of-reference",
     .meaning = "The DICOM slices do not share one frame of reference; that they lie in one space "
                "is taken from their positions.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kEmptyPlanes,
     .name = "empty-planes",
     .meaning =
         "A DICOM segmentation leaves out frames that show nothing; they are planes of zeros.",
     .is_in_mesh = true},
    {.code = NoteCode::kDistanceAssumed,
     .name = "distance-assumed",
     .meaning = "The DICOM image does not tell how far apart its slices are; the thickness of a "
                "slice was taken.",
     .is_in_mesh = true},
    {.code = NoteCode::kOverlappingSegments,
     .name = "overlapping-segments",
     .meaning = "Segments overlap; samples of several have values that number their combinations, "
                "and a label is all values that its segment is in.",
     .is_in_mesh = true},
    {.code = NoteCode::kFractionalSegments,
     .name = "fractional-segments",
     .meaning = "A DICOM segmentation tells shares or probabilities; a segment is where they are "
                "half of their maximum or more.",
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
