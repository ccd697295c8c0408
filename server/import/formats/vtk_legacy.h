// Structured points in VTK's legacy format, .vtk
// (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// True for all of VTK's legacy files; files without an image are rejected later, with the reason.
bool is_vtk_legacy(std::string_view head);

// True if such a file may hold an image, by its beginning.
bool may_hold_structured_points(std::string_view head);

// Reads the header and finds the scalars, of one component: of the point data, or, if there are
// none, of the cell data, whose samples lie at the cells' centres. VTK does not define its space's
// relation to the patient; LPS is assumed. Throws Error kUnusableVolume.
SourceVolume parse_vtk_legacy(const InputFile& file, const Companions& companions,
                              const ImportOptions& options);

// By the header. Throws as parse_vtk_legacy does, and Error kTooLarge beyond the limits.
MostBytes most_vtk_legacy_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
