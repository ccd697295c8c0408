#include "server/jobs/library/histograms.h"

#include <algorithm>
#include <functional>
#include <vector>

#include "server/jobs/library/intact_volume.h"
#include "server/mesh/parallel.h"
#include "server/volume/canonical.h"

namespace isomesh::jobs {
namespace {

constexpr std::uint64_t kBlockBytes = std::uint64_t{4} << 20;

// Counts the samples in these bytes, with at most one block of them in memory.
void add_part(const volume::CanonicalFile& canonical, std::uint64_t begin, std::uint64_t end,
              volume::ValueCounts& counts) {
  std::vector<std::byte> block;
  for (; begin < end; begin += block.size()) {
    block.resize(std::min(kBlockBytes, end - begin));
    canonical.read(begin, block);
    volume::add_values(block, canonical.header().type, counts);
  }
}

volume::ValueCounts count_values(const volume::CanonicalFile& canonical, const Volume& volume) {
  const std::uint64_t bytes = canonical.header().sample_bytes();
  const auto parts = std::clamp<std::uint64_t>(bytes / kBlockBytes, 1,
                                               static_cast<std::uint64_t>(mesh::thread_count()));
  const std::size_t sample_bytes = bytes_per_sample(volume.type);
  const std::uint64_t part_bytes = bytes / sample_bytes / parts * sample_bytes;
  std::vector<volume::ValueCounts> counts(parts, volume::no_values(volume.type, volume.range));
  mesh::parallel_for({}, parts, [&](std::size_t part) {
    const bool is_last = part + 1 == parts;
    add_part(canonical, part * part_bytes, is_last ? bytes : (part + 1) * part_bytes, counts[part]);
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
    const store::LocalBlob file = intact_volume(blobs_, volume.samples);
    return make_from_volume(blobs_, volume.samples, {},
                            [&] { return count_values(volume::CanonicalFile(file.path), volume); });
  });
  return {volume.id, volume.range, volume::rebinned(*values, bins)};
}

}  // namespace isomesh::jobs
