// The segments that 3D Slicer tells of in the header of an NRRD file, as own keys
// (https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html).
#pragma once

#include "server/import/formats/nrrd_space.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Whether the header tells of segments.
bool has_segments(const NrrdFields& fields);

// Sets `volume.labels`, and `volume.layers` where the file's volumes are layers of whole numbers
// and `is_layer_chosen` is false. A layer that is chosen has its own segments alone. A label is a
// segment's value; where another layer has the same value, it is a free number above all. Throws
// Error kUnusableVolume.
void set_segments(const NrrdFields& fields, bool is_interleaved, bool is_layer_chosen,
                  SourceVolume& volume);

}  // namespace isomesh::import
