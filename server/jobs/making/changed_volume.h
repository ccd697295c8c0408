// The note on a smoothing that changes what a surface encloses; private to this folder.
#pragma once

#include <optional>

#include "proto/notes.h"
#include "proto/parameters.h"
#include "proto/types.h"

namespace isomesh::jobs {

// The note volume-changed, if smoothing changed the volume of the summary by more than 5 %. The
// caller says whether the surface encloses one. To be called before simplification, which changes
// the volume, too.
std::optional<Note> note_on_changed_volume(const MeshParameters& parameters,
                                           const MeshSummary& smoothed);

}  // namespace isomesh::jobs
