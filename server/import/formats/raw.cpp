#include <string>

#include "base/files.h"
#include "proto/error.h"
#include "server/import/formats/format_readers.h"
#include "server/import/samples/transfer.h"

namespace isomesh::import {
namespace {

void check_size(const InputFile& file, const RawDescription& description, std::uint64_t samples) {
  const std::uint64_t expected = samples * bytes_per_sample(description.type);
  if (file.size() == expected) return;
  const auto& dims = description.dims;
  throw invalid_parameter("dims", std::to_string(dims[0]) + " x " + std::to_string(dims[1]) +
                                      " x " + std::to_string(dims[2]) + " samples of type " +
                                      std::string(to_string(description.type)) + " take " +
                                      std::to_string(expected) + " bytes, but the upload has " +
                                      std::to_string(file.size()) + " bytes");
}

Volume parse_raw(const Input& input) {
  const RawDescription& description = *input.task.options.raw;
  check_raw(description, input.task.limits);
  Volume volume;
  volume.dims = description.dims;
  volume.geometry = normalised(description.geometry);
  const InputFile file(input.path);
  check_size(file, description, volume.sample_count());
  return write_canonical(
      {file, 0, {stored_type(description.type), description.big_endian, std::nullopt}}, volume,
      input.task);
}

}  // namespace

constinit const Reader kRawReader = {.name = "raw", .parse = parse_raw};

}  // namespace isomesh::import
