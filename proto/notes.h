// What a volume says about how it was read. The codes stay, for programs; what each means is in one
// table, which openapi.yaml repeats. Thread safe.
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
  kSpaceAssumed,         // the file does not say how its axes lie in the patient
  kUnitUnknown,          // the file's unit is no length; taken for millimetres
  kNonFiniteSamples,     // some samples are no numbers or infinite; they are outside of any surface
  kTrailingBytes,        // the data is longer than the header tells
  kValuesRescaled,       // by a slope that other programs pass over
  kDuplicateFile,        // a file came twice and was taken once
  kLooksLikeLabels,      // told, or few whole values in flat regions: a job's `labels` suits it
  kFrameOfReference,     // DICOM: slices do not share one frame of reference
  kEmptyPlanes,          // DICOM: frames that a segmentation leaves out; they are planes of zeros
  kDistanceAssumed,      // DICOM: the distance between slices is not told; taken from the thickness
  kOverlappingSegments,  // segments overlap; values number their combinations
  kFractionalSegments,   // DICOM: segments are shares or probabilities; they begin at a half
};

struct NoteDescription {
  NoteCode code;
  std::string_view name;     // stable
  std::string_view meaning;  // one sentence
  // A refusal that a person may overrule: `accept=name` has the volume taken, with this note.
  bool is_acceptable = false;
  // The note tells how samples or geometry came about, so that a mesh carries it. Its detail then
  // never holds a name.
  bool is_in_mesh = false;
};

// All codes, each once.
std::span<const NoteDescription> note_descriptions();
const NoteDescription& describe(NoteCode code);
// Null for a name that this version does not know.
const NoteDescription* find_note(std::string_view name);

// The codes that `accept` takes, separated by commas, for a message.
std::string acceptable_notes();

// The code is text, because a client may talk to a newer server.
struct Note {
  std::string code;
  std::string detail;  // what of it is true of this volume, for a person

  bool operator==(const Note&) const = default;
};

Note note_of(NoteCode code, std::string detail);

// Those that stand in meshes, in their order.
std::vector<Note> notes_in_mesh(const std::vector<Note>& notes);

}  // namespace isomesh
