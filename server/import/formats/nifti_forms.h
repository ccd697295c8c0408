// The place of a NIfTI or Analyze volume: its sform, its qform, or its voxel sizes. Internal to the
// reader.
#pragma once

#include <string>

#include "server/import/formats/nifti_header.h"
#include "server/import/source/source.h"

namespace isomesh::import {

Note corrected_note(const std::string& corrections);

// In LPS millimetres, by the form that the options ask for, or else the sform if it is there. Adds
// notes to `volume`, whose dims are set. Throws Error kUnusableVolume, with choices if only one of
// two forms can be used.
Geometry nifti_geometry(const NiftiHeader& header, const ImportOptions& options,
                        SourceVolume& volume);

}  // namespace isomesh::import
