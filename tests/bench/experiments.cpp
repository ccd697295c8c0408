#include "tests/bench/experiments.h"

#include "tests/bench/peers.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr int kRuns = 5;
constexpr int kFewestSincPasses = 5;  // with fewer the filter finds no coefficients

}  // namespace

SurfaceFigures measure_surface(const Samples& samples, const Surface& surface) {
  Stages stages(samples, surface);
  stages.extract();  // to warm up
  SurfaceFigures figures;
  figures.extract_ms = median_ms({[&] { stages.extract(); }}, kRuns);
  figures.size = stages.size();
  figures.extracted = stages.shapes().aspect_ratio;
  figures.extracted_mm3 = stages.volume_mm3();
  figures.smooth_ms =
      median_ms({[&] { stages.smooth(kPasses); }, [&] { stages.extract(); }}, kRuns);
  figures.smoothed = stages.shapes().aspect_ratio;
  figures.smoothed_mm3 = stages.volume_mm3();
  figures.drc_bytes = stages.encode(Encoding::kEdgebreakerWhole);
  return figures;
}

std::vector<SmoothedFigures> measure_smoothed(const Samples& samples, const Surface& surface,
                                              Smoothing smoothing, std::span<const int> passes) {
  std::vector<SmoothedFigures> result;
  Stages stages(samples, surface);
  for (const int count : passes) {
    stages.extract();
    const double extracted_mm3 = stages.volume_mm3();
    stages.smooth(count, smoothing);
    result.push_back({count, stages.shapes(), stages.volume_mm3() / extracted_mm3});
  }
  return result;
}

std::optional<PaperFigures> measure_paper_smoothing(const Soup& soup, std::size_t sub_tables,
                                                    int passes) {
  PaperFigures figures;
  IndexedMesh mesh;
  figures.unique_ms = time_ms({[&] { mesh = find_unique(soup, sub_tables); }});
  if (mesh.search_steps() > kMostSearchSteps) return std::nullopt;
  NeighborLists neighbors;
  figures.neighbors_ms = time_ms({[&] { neighbors = find_neighbors(mesh); }});
  figures.passes_ms = time_ms({[&] { smooth(neighbors, passes, mesh); }});
  figures.triangles = mesh.triangles.size();
  figures.vertices = mesh.vertices.size();
  return figures;
}

PeerFigures measure_flying_edges(const Samples& samples, double iso) {
  Peers peers(samples, iso);
  peers.flying_edges();  // to warm up
  PeerFigures figures;
  figures.extract_ms = median_ms({[&] { peers.flying_edges(); }, [&] { peers.release(); }}, kRuns);
  figures.size = peers.size();
  return figures;
}

std::vector<PassesFigures> measure_passes(const Samples& samples, double iso,
                                          std::span<const int> passes) {
  std::vector<PassesFigures> result;
  Stages stages(samples, {.iso = iso});
  stages.extract();
  std::optional<Peers> peers;
  if (peers_available()) peers.emplace(samples, iso);
  for (const int count : passes) {
    PassesFigures figures{.passes = count};
    figures.ours_ms = median_ms({[&] {
                                  stages.extract();
                                  stages.smooth(count);
                                }},
                                kRuns);
    if (peers) {
      const auto release = [&] { peers->release(); };
      constexpr int kPeerRuns = 3;
      const auto peer_ms = [&](auto smooth) {
        return median_ms({[&] {
                            peers->flying_edges();
                            if (count > 0) smooth();
                          },
                          release},
                         kPeerRuns);
      };
      figures.peer_smooth_ms = peer_ms([&] { peers->smooth(count); });
      if (count >= kFewestSincPasses) {
        figures.peer_sinc_ms = peer_ms([&] { peers->windowed_sinc(count); });
      }
    }
    result.push_back(figures);
  }
  return result;
}

Samples resample_for_triangles(const Samples& samples, const Surface& surface,
                               std::uint64_t triangles) {
  const auto cube = [&](std::uint32_t n) { return resample(samples, {n, n, n}); };
  const auto count = [&](std::uint32_t n) {
    const Samples resampled = cube(n);
    return Stages(resampled, surface).count().triangles;
  };
  std::uint32_t low = 16;
  std::uint32_t high = 256;
  while (high - low > 1) {
    const std::uint32_t middle = (low + high) / 2;
    (count(middle) < triangles ? low : high) = middle;
  }
  return cube(triangles - count(low) < count(high) - triangles ? low : high);
}

GrowthFigures measure_growth(std::uint32_t size, int threads) {
  GrowthFigures figures{.size = size};
  constexpr int kJobRuns = 3;
  {
    const Samples field = synthetic_field(size);
    {
      Stages stages(field, {.iso = kFieldIso});
      stages.extract();
      stages.smooth(kPasses);
      figures.extract_ms = median_ms({[&] { stages.extract(); }}, kRuns);
      figures.smooth_ms =
          median_ms({[&] { stages.smooth(kPasses); }, [&] { stages.extract(); }}, kRuns);
      figures.job_ms = median_ms({[&] { stages.run_job(kPasses, MeshFormat::kDrc); }}, kJobRuns);
      figures.mesh = stages.size();
      figures.work = field.dims.samples() + figures.mesh.triangles;
    }
    if (peers_available()) {
      figures.peer_extract_ms = measure_flying_edges(field, kFieldIso).extract_ms;
      Peers peers(field, kFieldIso);
      figures.peer_job_ms =
          median_ms({[&] { peers.pipeline(); }, [&] { peers.release(); }}, kJobRuns);
    }
  }
  figures.extract_memory = measure_memory(kExtractStage, size, threads);
  figures.smooth_memory = measure_memory(kSmoothStage, size, threads);
  figures.job_memory = measure_memory(kJobStage, size, threads);
  if (peers_available()) {
    figures.peer_extract_memory = measure_memory(kPeerExtractStage, size, threads);
    figures.peer_job_memory = measure_memory(kPeerJobStage, size, threads);
  }
  return figures;
}

}  // namespace isomesh::bench
