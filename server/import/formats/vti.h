// VTK's XML image data, .vti (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// True for all of VTK's XML files; files without an image are rejected later, with the reason.
bool is_vti(std::string_view head);

// True if such a file may hold an image, by its beginning.
bool may_hold_image(std::string_view head);

// Reads the XML up to the samples. They are the scalars, of one component, in one piece that fills
// the whole extent: of the point data, or, if there are none, of the cell data at the cells'
// centres. VTK does not define its space's relation to the patient; LPS is assumed, as programs
// based on ITK write it. Throws Error kUnusableVolume.
SourceVolume parse_vti(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// By the image's extent, with room for further arrays. Throws Error kUnusableVolume if the
// beginning does not have it.
MostBytes most_vti_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
