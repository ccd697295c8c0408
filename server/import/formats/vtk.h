// The common part of VTK's two formats, and the arrays in the data section of a legacy file.
// Internal to their readers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
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

// An array of a legacy file.
struct VtkArray {
  std::string name;
  std::string type;  // as in the file: "unsigned_char"
  std::uint64_t components = 1;
  std::uint64_t tuples = 0;
  bool is_of_cells = false;
  bool is_scalars = false;   // by the keyword SCALARS
  bool is_colors = false;    // bytes, which text has as fractions of 255
  std::uint64_t offset = 0;  // of its data in the file
};

// The largest possible size of a VTK file with an image of this size.
MostBytes most_vtk_bytes(const std::array<std::uint32_t, 3>& dims, const ImportTask& task);

// Empty for names of no real number.
std::optional<StoredType> vtk_type(const std::string& name);

// The arrays from `offset` on, in their order, up to the first scalars of points. Throws Error
// kUnusableVolume if the file is damaged or has more than a thousand of them.
std::vector<VtkArray> vtk_arrays(const InputFile& file, std::uint64_t offset, bool is_text);

}  // namespace isomesh::import
