// The frames of a series -> the one volume of them that a request asks for.
#pragma once

#include <vector>

#include "proto/notes.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// The stack of the series, or of the volume that `options` choose among several: of times, echoes
// and the like, of several segmentations, or of a segmentation's segments. Adds to `notes` what was
// decided.
//
// Throws Error kUnusableVolume as make_stack and make_label_stack do, with the choices where there
// are several and none was chosen, and overridable where only the frames of reference are at fault.
Stack choose_stack(std::vector<Slice> slices, const ImportOptions& options,
                   std::vector<Note>& notes);

}  // namespace isomesh::import::dicom
