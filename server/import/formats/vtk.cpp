#include "server/import/formats/vtk.h"

#include <cstdlib>
#include <limits>
#include <optional>

#include "base/text.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"

namespace isomesh::import {

VtkExtent vtk_extent(std::string_view text, std::string_view name) {
  const auto parts = words(text);
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int32_t>::max();
  VtkExtent extent;
  std::array<std::uint64_t, 3> sizes = {0, 0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto first = parts.size() == 6 ? parse_int64(parts[axis * 2]) : std::nullopt;
    const auto last = parts.size() == 6 ? parse_int64(parts[axis * 2 + 1]) : std::nullopt;
    if (!first || !last || std::abs(*first) > kFarthest || std::abs(*last) > kFarthest ||
        *last < *first) {
      throw_unusable("The VTK file's " + in_quotes(name) +
                     " is not the first and last index along each of three axes.");
    }
    extent.first[axis] = *first;
    sizes[axis] = static_cast<std::uint64_t>(*last - *first + 1);
  }
  extent.dims = volume_dims(sizes);
  return extent;
}

bool is_vtk_mask(std::string_view name) {
  return name == "vtkGhostType" || name == "vtkValidPointMask";
}

std::string vtk_array_title(std::string_view name) { return "array " + in_quotes(name); }

}  // namespace isomesh::import
