// The common part of VTK's two formats. Internal to their readers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// The first index and the number of points along each axis.
struct VtkExtent {
  std::array<std::int64_t, 3> first = {0, 0, 0};
  std::array<std::uint32_t, 3> dims = {0, 0, 0};

  bool operator==(const VtkExtent&) const = default;
};

// Reads "0 3 0 2 0 1": the first and last index along each axis. Throws Error kUnusableVolume.
VtkExtent vtk_extent(std::string_view text, std::string_view name);

// True for the arrays in which VTK marks points and cells that are hidden or have no value.
bool is_vtk_mask(std::string_view name);

// The title of a volume that is one of several arrays.
std::string vtk_array_title(std::string_view name);

// The largest possible size of a VTK file with an image of this size.
MostBytes most_vtk_bytes(const std::array<std::uint32_t, 3>& dims, const ImportTask& task);

}  // namespace isomesh::import
