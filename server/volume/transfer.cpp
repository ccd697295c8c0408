#include "server/volume/transfer.h"

#include <utility>

#include "proto/error.h"
#include "server/volume/source.h"
#include "server/volume/statistics.h"

namespace isomesh::volume {

Volume write_canonical(const PlainSamples& samples, Volume volume,
                       const std::filesystem::path& target) {
  volume.type = canonical_type(samples.layout);
  CanonicalWriter writer(target, {volume.dims, volume.type, volume.geometry});
  read_samples(samples.file, samples.offset, samples.layout, writer.samples());
  return finish(writer, std::move(volume));
}

Volume finish(CanonicalWriter& writer, Volume volume) {
  const Statistics statistics = measure(writer.samples(), volume.type);
  if (statistics.non_finite > 0) {
    throw_unusable(std::to_string(statistics.non_finite) + " of its " +
                   std::to_string(volume.sample_count()) + " samples are not finite numbers.");
  }
  writer.finish();
  volume.range = statistics.range;
  volume.suggested_iso = statistics.otsu;
  volume.bytes = writer.samples().size();
  return volume;
}

void check_limits(std::uint64_t sample_count, SampleType type, const ImportLimits& limits) {
  if (sample_count <= limits.max_sample_bytes / bytes_per_sample(type)) return;
  throw Error(ErrorCode::kTooLarge,
              "Its samples are " + std::to_string(sample_count * bytes_per_sample(type)) +
                  " bytes, more than the " + std::to_string(limits.max_sample_bytes) +
                  " that are accepted.");
}

}  // namespace isomesh::volume
