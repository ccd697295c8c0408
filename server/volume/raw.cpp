#include "server/volume/raw.h"

#include <string>

#include "proto/error.h"
#include "server/volume/geometry.h"
#include "server/volume/source.h"
#include "server/volume/transfer.h"

namespace isomesh::volume {
namespace {

// Throws for the sizes that a request names, as volume_dims does for those in a file.
void check_dims(const RawDescription& description) {
  const std::array<std::uint64_t, 3> sizes = {description.dims[0], description.dims[1],
                                              description.dims[2]};
  try {
    volume_dims(sizes);
  } catch (const Error& error) {
    throw invalid_parameter("dims", error.what());
  }
}

void check_size(const InputFile& file, const RawDescription& description, std::uint64_t samples) {
  const std::uint64_t expected = samples * bytes_per_sample(description.type);
  if (file.size() == expected) return;
  const auto& dims = description.dims;
  throw invalid_parameter("dims", std::to_string(dims[0]) + " x " + std::to_string(dims[1]) +
                                      " x " + std::to_string(dims[2]) + " samples of type " +
                                      std::string(to_string(description.type)) + " are " +
                                      std::to_string(expected) + " bytes, but the body has " +
                                      std::to_string(file.size()));
}

}  // namespace

void check_raw(const RawDescription& description, const ImportLimits& limits) {
  check_dims(description);
  if (const auto fault = find_fault(description.dims, description.geometry)) {
    throw invalid_parameter(fault->field, fault->message);
  }
  const auto& dims = description.dims;
  check_limits(std::uint64_t{dims[0]} * dims[1] * dims[2], description.type, limits);
}

Volume import_raw(const std::filesystem::path& source, const RawDescription& description,
                  const ImportLimits& limits, const std::filesystem::path& target) {
  check_raw(description, limits);
  Volume volume;
  volume.format = "raw";
  volume.dims = description.dims;
  volume.geometry = normalised(description.geometry);
  const InputFile file(source);
  check_size(file, description, volume.sample_count());
  return write_canonical(
      {file, 0, {stored_type(description.type), description.big_endian, std::nullopt}}, volume,
      target);
}

}  // namespace isomesh::volume
