#include "server/volume/source.h"

#include <limits>

#include "proto/error.h"
#include "server/volume/text.h"

namespace isomesh::volume {
namespace {

void check_beyond(std::span<const std::uint64_t> sizes) {
  for (std::size_t axis = 3; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 1) continue;
    const std::string size = std::to_string(sizes[axis]);
    throw_unusable(axis == 3 ? "The file holds a time series of " + size +
                                   " volumes, where one volume is needed."
                             : "The file has " + size + " values along its axis " +
                                   axis_name(axis) + ", where one volume is needed.");
  }
}

}  // namespace

void throw_unusable(const std::string& reason) { throw Error(ErrorCode::kUnusableVolume, reason); }

std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMostSamples = std::uint64_t{1} << 60;
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::uint64_t samples = 1;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
  }
  check_beyond(sizes);
  for (std::size_t axis = 0; axis < sizes.size() && axis < dims.size(); ++axis) {
    if (sizes[axis] > std::numeric_limits<std::uint32_t>::max() ||
        samples > kMostSamples / sizes[axis]) {
      throw_unusable("The header's sizes are not believable: " + std::to_string(sizes[axis]) +
                     " along " + axis_name(axis) + ".");
    }
    samples *= sizes[axis];
    dims[axis] = static_cast<std::uint32_t>(sizes[axis]);
  }
  return dims;
}

}  // namespace isomesh::volume
