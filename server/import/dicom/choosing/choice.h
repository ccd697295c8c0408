// The frames of a series -> the requested volume.
#pragma once

#include <vector>

#include "proto/notes.h"
#include "server/import/dicom/choosing/duplicates.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// Returns the stack of the series. If the series has several volumes (times, echoes, several
// segmentations, a segmentation's segments), `options` select one. Adds the decisions to `notes`.
//
// Throws Error kUnusableVolume as make_stack and make_label_stack do; with the choices if there are
// several volumes and none was selected; overridable if the slices are one volume under an
// assumption that a person can confirm.
Stack choose_stack(std::vector<Slice> slices, const SameSamples& same_samples,
                   const ImportOptions& options, std::vector<Note>& notes);

}  // namespace isomesh::import::dicom
