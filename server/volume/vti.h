// VTK's XML image data, .vti (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <string_view>

#include "server/volume/source.h"

namespace isomesh::volume {

// True for all of VTK's XML files; those that hold no image are refused with the reason.
bool is_vti(std::string_view head);

// Reads the XML up to the samples. They are the point data's scalars, of one component, in the one
// piece that fills the whole extent. VTK knows no patient: its space is taken for LPS, as ITK's
// programs write it. Throws Error kUnusableVolume.
SourceVolume parse_vti(const InputFile& file);

}  // namespace isomesh::volume
