#include "server/jobs/histograms.h"

#include <algorithm>
#include <span>
#include <vector>

#include "server/jobs/stored_samples.h"
#include "server/mesh/parallel.h"
#include "server/volume/canonical.h"

namespace isomesh::jobs {
namespace {

volume::ValueCounts count_values(const volume::CanonicalVolume& canonical, const Volume& volume) {
  const std::span<const std::byte> samples = canonical.samples();
  constexpr std::size_t kSmallestPart = std::size_t{4} << 20;
  const std::size_t parts = std::clamp<std::size_t>(samples.size() / kSmallestPart, 1,
                                                    static_cast<std::size_t>(mesh::thread_count()));
  const std::size_t sample_bytes = bytes_per_sample(volume.type);
  const std::size_t part_bytes = samples.size() / sample_bytes / parts * sample_bytes;
  std::vector<volume::ValueCounts> counts(parts, volume::no_values(volume.type, volume.range));
  mesh::parallel_for({}, parts, [&](std::size_t part) {
    const bool is_last = part + 1 == parts;
    volume::add_values(
        samples.subspan(part * part_bytes, is_last ? std::dynamic_extent : part_bytes), volume.type,
        counts[part]);
  });
  for (std::size_t part = 1; part < parts; ++part) {
    std::ranges::transform(counts[0].counts, counts[part].counts, counts[0].counts.begin(),
                           std::plus());
  }
  return std::move(counts[0]);
}

}  // namespace

Histogram Histograms::of(const store::Viewer& viewer, const Volume& volume, std::size_t bins) {
  const auto values = counts_.get({viewer, volume.id}, [&] {
    const store::LocalBlob file = stored_samples(blobs_, volume.id);
    return count_values(volume::CanonicalVolume(file.path), volume);
  });
  return {volume.id, volume.range, volume::rebinned(*values, bins)};
}

}  // namespace isomesh::jobs
