// The measurements that the report is made of. Times are medians unless said otherwise.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "tests/bench/memory.h"
#include "tests/bench/paper.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {

// One surface through the stages.
struct SurfaceFigures {
  MeshSize size;
  double extract_ms = 0;
  double smooth_ms = 0;  // 5 passes, connectivity included
  std::uint64_t drc_bytes = 0;
  Distribution extracted;  // aspect ratios
  Distribution smoothed;
  double extracted_mm3 = 0;
  double smoothed_mm3 = 0;
};
SurfaceFigures measure_surface(const Samples& samples, const Surface& surface);

// What a number of passes makes of a surface.
struct SmoothedFigures {
  int passes = 0;
  mesh::Shapes shapes;
  double volume_kept = 1;  // the enclosed volume as a share of that before smoothing
};
std::vector<SmoothedFigures> measure_smoothed(const Samples& samples, const Surface& surface,
                                              Smoothing smoothing, std::span<const int> passes);

// The paper's own way on this machine, one run.
struct PaperFigures {
  std::size_t triangles = 0;
  std::size_t vertices = 0;  // unique ones
  double unique_ms = 0;
  double neighbors_ms = 0;
  double passes_ms = 0;

  double total_ms() const { return unique_ms + neighbors_ms + passes_ms; }
};

// Empty when the search for neighbours would look at more than kMostSearchSteps triangles.
inline constexpr double kMostSearchSteps = 6e9;
std::optional<PaperFigures> measure_paper_smoothing(const Soup& soup, std::size_t sub_tables,
                                                    int passes);

// Flying Edges, and on its mesh VTK's two smoothing filters. Only with peers.
struct PeerFigures {
  MeshSize size;
  double extract_ms = 0;
};
PeerFigures measure_flying_edges(const Samples& samples, double iso);

// Time of extraction and smoothing with a number of passes.
struct PassesFigures {
  int passes = 0;
  double ours_ms = 0;
  double peer_smooth_ms = 0;  // Flying Edges and vtkSmoothPolyDataFilter; 0 without peers
  double peer_sinc_ms = 0;    // Flying Edges and windowed sinc; 0 below its fewest passes too
};
std::vector<PassesFigures> measure_passes(const Samples& samples, double iso,
                                          std::span<const int> passes);

// A cube of n^3 samples of the same box of space, n between 16 and 256, whose surface comes closest
// to that number of triangles.
Samples resample_for_triangles(const Samples& samples, const Surface& surface,
                               std::uint64_t triangles);

// The synthetic field of one size.
struct GrowthFigures {
  std::uint32_t size = 0;
  std::uint64_t work = 0;  // samples + triangles
  MeshSize mesh = {};
  double extract_ms = 0;
  double smooth_ms = 0;
  double job_ms = 0;
  double peer_extract_ms = 0;  // 0 without peers
  double peer_job_ms = 0;
  std::optional<PeakMemory> extract_memory = {};
  std::optional<PeakMemory> smooth_memory = {};
  std::optional<PeakMemory> job_memory = {};
  std::optional<PeakMemory> peer_extract_memory = {};
  std::optional<PeakMemory> peer_job_memory = {};
};
GrowthFigures measure_growth(std::uint32_t size, int threads);

}  // namespace isomesh::bench
