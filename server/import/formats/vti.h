// VTK's XML image data, .vti (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// True for all of VTK's XML files; those that hold no image are refused with the reason.
bool is_vti(std::string_view head);

// Whether such a file may hold an image, as far as its beginning tells.
bool may_hold_image(std::string_view head);

// Reads the XML up to the samples. They are the scalars of the point data, of one component, in one
// piece that fills the whole extent. VTK does not say how its space lies in the patient; it is
// taken for LPS, as programs made with ITK write it. Throws Error kUnusableVolume.
SourceVolume parse_vti(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// As the image's extent tells, with room for other arrays than the samples. Throws Error
// kUnusableVolume where the file does not begin with that.
MostBytes most_vti_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
