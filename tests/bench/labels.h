// All labels of a segmentation, beside what others take for them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/label_walls.h"
#include "tests/bench/ratios.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"
#include "tests/bench/surface_nets.h"

namespace isomesh::bench {

// The body of the given size, and the atlases of Debian's package mricron-data that are installed.
std::vector<Samples> segmentations(std::uint32_t body_samples);

struct LabelPlan {
  int threads = 1;
  std::filesystem::path surface_nets_root;  // see surface_nets.h; empty: without SurfaceNets
};

// Extraction of all labels, with and without smoothing, over what the peers take for them, to
// vertices and triangles in memory; and what each label's measures take. Without peers ours alone.
std::vector<Finding> measure_label_findings(const Samples& samples, const LabelPlan& plan);

// How the smoothed surfaces of all labels share out space, made in one way.
struct LabelQuality {
  std::string way;
  MeshSize size;
  Sharing sharing;
  // Enclosed volume divided by the volume of the voxels, minus one: for all labels together and for
  // the worst. Unknown if the triangles have no winding.
  struct Volumes {
    double all = 0;
    double worst = 0;
    std::int64_t worst_label = 0;
    std::uint64_t worst_voxels = 0;
  };
  std::optional<Volumes> volumes;
};

// The figures of ours with two smoothings, and of the peers that are installed.
std::vector<LabelQuality> measure_label_quality(const Samples& samples, const LabelPlan& plan);

// An object for each.
Json to_json(const std::vector<LabelQuality>& qualities);

}  // namespace isomesh::bench
