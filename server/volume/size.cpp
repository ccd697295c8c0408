#include "server/volume/size.h"

#include <cassert>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/text.h"
#include "server/volume/geometry.h"
#include "server/volume/unusable.h"

namespace isomesh::volume {
namespace {

// Checks the sizes of a request, as volume_dims does for a file.
void check_dims(const RawDescription& description) {
  const std::array<std::uint64_t, 3> sizes = {description.dims[0], description.dims[1],
                                              description.dims[2]};
  try {
    volume_dims(sizes);
  } catch (const Error& error) {
    throw invalid_parameter("dims", error.what());
  }
}

}  // namespace

std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMostSamples = std::uint64_t{1} << 60;
  assert(sizes.size() <= 3);
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::uint64_t samples = 1;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
    if (sizes[axis] > std::numeric_limits<std::uint32_t>::max() ||
        samples > kMostSamples / sizes[axis]) {
      throw_unusable("The size along " + axis_name(axis) +
                     " is not plausible: " + std::to_string(sizes[axis]) + ".");
    }
    samples *= sizes[axis];
    dims[axis] = static_cast<std::uint32_t>(sizes[axis]);
  }
  return dims;
}

void check_limits(std::uint64_t sample_count, SampleType type, const SizeLimits& limits) {
  if (sample_count <= limits.max_sample_bytes / bytes_per_sample(type)) return;
  throw Error(ErrorCode::kTooLarge, "The volume is too large: its samples take " +
                                        std::to_string(sample_count * bytes_per_sample(type)) +
                                        " bytes, and at most " +
                                        std::to_string(limits.max_sample_bytes) + " are accepted.");
}

void check_raw(const RawDescription& description, const SizeLimits& limits) {
  check_dims(description);
  if (const auto fault = find_fault(description.dims, description.geometry)) {
    throw invalid_parameter(fault->field, fault->message);
  }
  const auto& dims = description.dims;
  check_limits(std::uint64_t{dims[0]} * dims[1] * dims[2], description.type, limits);
}

}  // namespace isomesh::volume
