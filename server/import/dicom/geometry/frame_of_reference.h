// Checks that slices share one coordinate system.
#pragma once

#include <optional>
#include <span>

#include "proto/notes.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// Positions refer to a frame of reference, which all slices of a volume share. Some anonymisers
// give each slice a different one, or none. Then the only evidence is that the slices lie evenly
// spaced on one line, which the caller has checked. This suffices if every slice has a different
// frame of reference or none; a note reports it. Groups of slices may come from several coordinate
// systems and are rejected unless `options` accept them.
//
// Returns a note if the slices have several. Throws Error kUnusableVolume, overridable.
std::optional<Note> note_on_frames_of_reference(std::span<const Slice> slices,
                                                const ImportOptions& options);

}  // namespace isomesh::import::dicom
