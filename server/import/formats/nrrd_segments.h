// The segments that an NRRD header names: those of 3D Slicer and of MITK, both in private pairs. A
// layer of 3D Slicer and a group of MITK are one of the file's volumes.
#pragma once

#include "server/import/formats/nrrd_space.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// True if the header names segments, or says that it is a segmentation.
bool has_segments(const NrrdFields& fields);

// True for those of 3D Slicer, which may leave out the empty part of the lattice. MITK keeps that
// of the image.
bool has_cropped_segments(const NrrdFields& fields);

// Sets `volume.labels`, and `volume.layers` if the file's volumes are layers of integers and
// `is_layer_chosen` is false. A selected layer has only its own segments. A label is a segment's
// value; if another layer uses the same value, it is a free number above all. Throws Error
// kUnusableVolume.
void set_segments(const NrrdFields& fields, bool is_interleaved, bool is_layer_chosen,
                  SourceVolume& volume);

}  // namespace isomesh::import
