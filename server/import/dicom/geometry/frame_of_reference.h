// Whether slices may be said to lie in one space.
#pragma once

#include <optional>
#include <span>

#include "proto/notes.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// Positions are told in a frame of reference, which all slices of a volume share. Some anonymisers
// give each slice another one, or none. What they have in common is then only that they lie on one
// even line, which the caller has made sure of: that is taken as enough where every slice has
// another frame of reference or none, and noted. Where they fall into groups, they may come from
// several places: that is refused, unless `options` accept it.
//
// Returns a note where the slices have several. Throws Error kUnusableVolume, overridable.
std::optional<Note> note_on_frames_of_reference(std::span<const Slice> slices,
                                                const ImportOptions& options);

}  // namespace isomesh::import::dicom
