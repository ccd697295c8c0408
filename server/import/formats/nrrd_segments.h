// 3D Slicer's segments in the header of an NRRD file, as private keys
// (https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html).
#pragma once

#include "server/import/formats/nrrd_space.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool has_segments(const NrrdFields& fields);

// Sets `volume.labels`, and `volume.layers` if the file's volumes are layers of integers and
// `is_layer_chosen` is false. A selected layer has only its own segments. A label is a segment's
// value; if another layer uses the same value, it is a free number above all. Throws Error
// kUnusableVolume.
void set_segments(const NrrdFields& fields, bool is_interleaved, bool is_layer_chosen,
                  SourceVolume& volume);

}  // namespace isomesh::import
