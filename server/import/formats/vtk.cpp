#include "server/import/formats/vtk.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "base/text.h"
#include "server/import/source/names.h"
#include "server/import/source/reader.h"

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

MostBytes most_vtk_bytes(const std::array<std::uint32_t, 3>& dims, const ImportTask& task) {
  // Per sample, in all arrays together: 32 numbers as text.
  constexpr std::uint64_t kMostPerSample = 1024;
  const std::uint64_t samples = std::uint64_t{dims[0]} * dims[1] * dims[2];
  const std::uint64_t most = task.limits.max_sample_bytes;
  return {.file = std::min(most, std::min(most, samples) * kMostPerSample) + kHeadroomBytes};
}

}  // namespace isomesh::import
