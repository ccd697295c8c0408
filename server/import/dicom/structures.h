// An RT structure set -> a canonical volume of labels.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "proto/types.h"
#include "server/import/dicom/choosing/series.h"
#include "server/import/dicom/contours/contour_grid.h"
#include "server/import/source/reader.h"

namespace isomesh::import::dicom {

// Draws the structures of the file at `path` on `images`, the grid of their series
// (grid_of_images), or, if that is
// empty or the options give a spacing, on a grid around them. The options select one structure.
// Structures that overlap are combined as segments are (combinations.h).
//
// Throws Error kUnusableVolume as read_structures and grid_around do, if nothing lies on the grid,
// and if there is no grid; kTooLarge, kOutOfSpace, kInternal.
Volume import_structures(const std::filesystem::path& path,
                         const std::optional<ContourGrid>& images, const ImportTask& task);

}  // namespace isomesh::import::dicom
