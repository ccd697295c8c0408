// The arrays in the data section of a legacy VTK file. Internal to the readers of VTK.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

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
