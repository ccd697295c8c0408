// Notes on how a volume was read, and on how its mesh was made. The codes are stable, for programs.
// One table holds their meanings, which openapi.yaml repeats. Thread safe.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

enum class NoteCode {
  kFormsDiffer,          // NIfTI: sform and qform place the samples differently
  kPixdimDiffers,        // NIfTI: the voxel sizes are not the lengths of the sform's steps
  kVolumeChosen,         // one of several volumes of the file
  kSpaceAssumed,         // the file does not define its axes in the patient
  kUnitUnknown,          // the file's unit is not a length; or no spacing; taken as millimetres
  kUnitAngstrom,         // coordinates are in angstrom, wherever millimetres are told
  kNonFiniteSamples,     // some samples are NaN or infinite; they are outside of any surface
  kTrailingBytes,        // the data is longer than the header says
  kValuesRescaled,       // by a slope that other programs ignore
  kDuplicateFile,        // a file occurs twice and was used once
  kLooksLikeLabels,      // declared, few whole values in flat regions, or a mask: `labels` suits it
  kFrameOfReference,     // DICOM: slices do not share one frame of reference
  kEmptyPlanes,          // planes of zeros in a segmentation, between its frames or at its ends
  kDistanceAssumed,      // DICOM: no distance between slices; taken from the thickness
  kOverlappingSegments,  // segments overlap; values number their combinations
  kContoursSkipped,      // DICOM: contours or structures of a structure set that were not drawn
  kContoursInterpolated,  // DICOM: shapes of structures in slices between their contours
  kFractionalSegments,    // DICOM: segments are fractions or probabilities; thresholded at one half
  kPadding,               // samples of the file's padding value; they are outside of any surface
  kDuplicateSlice,        // DICOM: two slices at one position; one is used
  kDirectionsCorrected,   // axes that are not quite perpendicular; made so
  kPositionsRounded,      // DICOM: positions of slices are rounded; evenly spaced ones fit
  kFramesAsSlices,        // frames in time or of a list; read as slices
  kHeaderCorrected,       // a field of the header that contradicts the rest; read as others do
  kRescaleIgnored,        // an offset that does not apply by the standard; others add it
  kLabelsRounded,         // labels as floats that are nearly whole; rounded
  kLabelsRenumbered,      // labels of more than 32 bits; the samples have other numbers
  kChunksMissing,         // Zarr: some chunks are not there; their samples have the fill value
  kOrientationChanged,    // somebody flipped or turned the volume after its upload
  kThinWalls,             // of a mesh: cavities are open because their walls are thin
  kVolumeChanged,         // of a mesh: smoothing changed its volume by more than 5 %
};

struct NoteDescription {
  NoteCode code;
  std::string_view name;
  std::string_view meaning;
  // The code belongs to an error that a user may override: with `accept=name` the volume is taken
  // and has this note.
  bool is_acceptable = false;
  // The note concerns the origin of samples or geometry, so meshes carry it. Its detail then never
  // holds a name.
  bool is_in_mesh = false;
  // The note is a mesh's own (MeshSummary::notes), and no volume has it.
  bool is_of_mesh = false;
};

std::span<const NoteDescription> note_descriptions();
const NoteDescription& describe(NoteCode code);
// Returns null for a name that this version does not know.
const NoteDescription* find_note(std::string_view name);

// The codes that `accept` takes, separated by commas, for messages.
std::string acceptable_notes();

// The code is text because a newer server may send unknown ones.
struct Note {
  std::string code;
  std::string detail;  // about this volume, for a person

  bool operator==(const Note&) const = default;
};

Note note_of(NoteCode code, std::string detail);

std::vector<Note> notes_in_mesh(const std::vector<Note>& notes);

// The unit of a volume's coordinates, and so of the lengths of its meshes.
struct LengthUnit {
  std::string_view symbol;  // "mm" or "angstrom"
  std::string_view name;    // "millimetres" or "angstrom"
  double metres;

  bool operator==(const LengthUnit&) const = default;
};

// `notes`: the volume's, or those in its mesh.
LengthUnit length_unit(const std::vector<Note>& notes);

}  // namespace isomesh
