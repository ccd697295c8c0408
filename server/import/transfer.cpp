#include "server/import/transfer.h"

#include <utility>

#include "proto/error.h"
#include "server/import/payload.h"
#include "server/volume/statistics.h"

namespace isomesh::import {
namespace {

Geometry usable_geometry(const SourceVolume& source) {
  const Geometry geometry = normalised(source.geometry);
  if (const auto fault = find_fault(source.dims, geometry)) {
    throw_unusable("The file's geometry cannot be used: " + fault->message + ".");
  }
  return geometry;
}

}  // namespace

Volume write_canonical(const PlainSamples& samples, Volume volume,
                       const std::filesystem::path& target) {
  volume.type = canonical_type(samples.layout);
  CanonicalWriter writer(target, {volume.dims, volume.type, volume.geometry});
  read_samples(samples.file, samples.offset, samples.layout, writer.samples());
  return finish(writer, std::move(volume));
}

Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task) {
  Volume volume;
  volume.dims = source.dims;
  volume.geometry = usable_geometry(source);
  // Raw samples are first compared with the size of their file, so that a file that is too short is
  // refused as truncated even where its header tells of more samples than are accepted.
  if (source.encoding != Encoding::kRaw) check_limits(source, task.limits);
  const Payload payload(file, source, task.scratch);
  check_limits(source, task.limits);
  return write_canonical({payload.file(), payload.offset(), payload.layout()}, std::move(volume),
                         task.target);
}

Volume finish(CanonicalWriter& writer, Volume volume) {
  const volume::Statistics statistics = volume::measure(writer.samples(), volume.type);
  if (statistics.non_finite > 0) {
    throw_unusable(std::to_string(statistics.non_finite) + " of its " +
                   std::to_string(volume.sample_count()) + " samples are not finite numbers.");
  }
  volume.range = statistics.range;
  volume.suggested_iso = statistics.otsu;
  volume.bytes = writer.samples().size();
  return volume;
}

}  // namespace isomesh::import
