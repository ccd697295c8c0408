#include "proto/notes.h"

#include <algorithm>
#include <utility>

namespace isomesh {
namespace {

constexpr NoteDescription kNoteDescriptions[] = {
    {.code = NoteCode::kFormsDiffer,
     .name = "forms-differ",
     .meaning =
         "The sform and qform of a NIfTI header place the samples differently. The detail says "
         "by how much and which one was used.",
     .is_in_mesh = true},
    {.code = NoteCode::kPixdimDiffers,
     .name = "pixdim-differs",
     .meaning = "The voxel sizes of a NIfTI header differ from the steps of its sform. The sform "
                "was used.",
     .is_in_mesh = true},
    {.code = NoteCode::kVolumeChosen,
     .name = "volume-chosen",
     .meaning = "The file holds several volumes. The request selected this one.",
     .is_in_mesh = true},
    {.code = NoteCode::kSpaceAssumed,
     .name = "space-assumed",
     .meaning = "The file does not say how its axes lie in the patient. The detail says what was "
                "assumed.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kUnitUnknown,
     .name = "unit-unknown",
     .meaning = "The file's unit is not a length, or the file gives no spacing. One unit was read "
                "as one millimetre.",
     .is_in_mesh = true},
    {.code = NoteCode::kUnitAngstrom,
     .name = "unit-angstrom",
     .meaning = "The coordinates are in angstrom, as in the file. Lengths, areas and volumes that "
                "are given in millimetres are in angstrom, too.",
     .is_in_mesh = true},
    {.code = NoteCode::kNonFiniteSamples,
     .name = "non-finite-samples",
     .meaning = "Some samples are infinite or not a number. They got the smallest sample's value, "
                "or 0 if all others are larger whole numbers, so they lie outside the surface at "
                "any larger iso-value, and inside it with `inside=below`. The suggested iso-value "
                "leaves them out.",
     .is_in_mesh = true},
    {.code = NoteCode::kTrailingBytes,
     .name = "trailing-bytes",
     .meaning = "The data is longer than the header declares. The extra bytes were ignored."},
    {.code = NoteCode::kValuesRescaled,
     .name = "values-rescaled",
     .meaning = "The samples were changed by the header's slope and offset, which other programs "
                "ignore.",
     .is_in_mesh = true},
    {.code = NoteCode::kDuplicateFile,
     .name = "duplicate-file",
     .meaning = "A file came more than once and was read once."},
    {.code = NoteCode::kLooksLikeLabels,
     .name = "looks-like-labels",
     .meaning =
         "The file describes labels, or the samples look like labels: few whole values in flat "
         "regions, or only 0 and one larger whole value, as in a mask. A job with `labels` meshes "
         "each label. An iso-value makes one surface around all samples above it, and small "
         "structures of a mask lose volume."},
    {.code = NoteCode::kFrameOfReference,
     .name = "frame-of-reference",
     .meaning =
         "The DICOM slices do not share one frame of reference. They were read as one volume "
         "because of their positions.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kEmptyPlanes,
     .name = "empty-planes",
     .meaning = "A segmentation leaves out empty frames, or its labels reach its end. Planes of "
                "zeros were added there, so surfaces are closed.",
     .is_in_mesh = true},
    {.code = NoteCode::kDistanceAssumed,
     .name = "distance-assumed",
     .meaning =
         "The DICOM image does not give the distance between its slices, so the slice thickness "
         "was used. Or its frames have no positions, and the request places them along the normal.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kOverlappingSegments,
     .name = "overlapping-segments",
     .meaning = "Segments overlap. Samples of several segments have values that stand for the "
                "combination. "
                "A label consists of all values of its segment.",
     .is_in_mesh = true},
    {.code = NoteCode::kContoursSkipped,
     .name = "contours-skipped",
     .meaning =
         "A DICOM structure set has contours or structures that were not drawn, or not beyond "
         "the grid. The detail says how many and why.",
     .is_in_mesh = true},
    {.code = NoteCode::kContoursInterpolated,
     .name = "contours-interpolated",
     .meaning = "A structure of a DICOM structure set has no contours in some slices between "
                "others. Its shape was interpolated there.",
     .is_in_mesh = true},
    {.code = NoteCode::kFractionalSegments,
     .name = "fractional-segments",
     .meaning =
         "A DICOM segmentation holds fractions or probabilities. A sample belongs to a segment if "
         "its value is half of the maximum or more.",
     .is_in_mesh = true},
    {.code = NoteCode::kPadding,
     .name = "padding",
     .meaning = "Some samples have the padding value of the file, which is not part of the image. "
                "They got the smallest other sample's value, so they lie outside the surface at "
                "any larger iso-value, and inside it with `inside=below`. The range and the "
                "suggested iso-value leave them out. With "
                "`accept=padding` they are samples like others.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kDuplicateSlice,
     .name = "duplicate-slice",
     .meaning = "Several slices lie at one position. One was used, and the files of the others are "
                "listed as ignored. If their samples differ, the request accepts it.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kDirectionsCorrected,
     .name = "directions-corrected",
     .meaning = "The directions of rows and columns are not quite perpendicular, or not quite unit "
                "vectors. The nearest perpendicular ones were used.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kPositionsRounded,
     .name = "positions-rounded",
     .meaning = "The positions of the slices are not evenly spaced. Evenly spaced ones were used "
                "that lie within the rounding of the positions, or that the request accepts.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kFramesAsSlices,
     .name = "frames-as-slices",
     .meaning =
         "The file holds flat images along an axis that is not one of space, such as time or a "
         "list. They were read as the slices of a volume.",
     .is_acceptable = true,
     .is_in_mesh = true},
    {.code = NoteCode::kHeaderCorrected,
     .name = "header-corrected",
     .meaning = "A field of the header contradicts the rest or has no meaning. It was read as "
                "other programs read it. The detail says which field, and how.",
     .is_in_mesh = true},
    {.code = NoteCode::kRescaleIgnored,
     .name = "rescale-ignored",
     .meaning = "The header has an offset of values that does not apply by the standard of the "
                "format. Other programs add it.",
     .is_in_mesh = true},
    {.code = NoteCode::kLabelsRounded,
     .name = "labels-rounded",
     .meaning = "Labels are stored as floats that are not quite whole numbers. They were rounded.",
     .is_in_mesh = true},
    {.code = NoteCode::kLabelsRenumbered,
     .name = "labels-renumbered",
     .meaning = "The labels have more than 32 bits. The samples have other numbers; lists, names "
                "and meshes have the file's.",
     .is_in_mesh = true},
    {.code = NoteCode::kChunksMissing,
     .name = "chunks-missing",
     .meaning = "Some chunks of a Zarr array are missing. Their samples have the fill value.",
     .is_in_mesh = true},
    {.code = NoteCode::kOrientationChanged,
     .name = "orientation-changed",
     .meaning = "Somebody flipped or turned the volume, because its file places it wrongly. The "
                "detail says how. Positions differ from those in the file.",
     .is_in_mesh = true},
    {.code = NoteCode::kThinWalls,
     .name = "thin-walls",
     .meaning =
         "Only of a mesh. A cavity of at least 8 voxels is closed by the faces of voxels, but open "
         "in the surface: its wall is thinner than the longest edges of the lattice. The detail "
         "names another `scheme`, if one closes more of the cavities. Jobs by labels, jobs with "
         "`fill_cavities` or `components`, and those on masks look for such cavities.",
     .is_of_mesh = true},
    {.code = NoteCode::kVolumeChanged,
     .name = "volume-changed",
     .meaning = "Only of a closed mesh at an iso-value. Smoothing changed its volume by more than "
                "5 %. The detail says by how much, and which parameters change it less. Thin parts "
                "and sharp edges lose the most.",
     .is_of_mesh = true},
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

LengthUnit length_unit(const std::vector<Note>& notes) {
  constexpr LengthUnit kMillimetre = {"mm", "millimetres", 1e-3};
  constexpr LengthUnit kAngstrom = {"angstrom", "angstrom", 1e-10};
  const bool is_angstrom =
      std::ranges::find(notes, describe(NoteCode::kUnitAngstrom).name, &Note::code) != notes.end();
  return is_angstrom ? kAngstrom : kMillimetre;
}

}  // namespace isomesh
