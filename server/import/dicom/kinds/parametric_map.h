// Parametric maps (PS3.3, A.75): a mapping to real world values gives their samples a meaning.
#pragma once

#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

bool is_parametric_map(const DataSet& data);

// Sets the frame's rescale to its mapping (PS3.3, C.7.6.16.2.11), which stands for a rescale. If
// several mappings differ, such as those to other units, the first is used that covers the stored
// values of the others. Returns the number of different mappings, 0 if there are none.
//
// Throws Error kUnusableVolume if the frame has only lookup tables, a mapping without a finite
// slope and intercept, or mappings that cover different values.
std::uint32_t set_real_world_values(const Attributes& attributes, const PixelLayout& stored,
                                    Frame& frame);

}  // namespace isomesh::import::dicom
