// All labels of a segmentation, beside what others take for them.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/findings.h"
#include "tests/bench/samples.h"

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

}  // namespace isomesh::bench
