// The paper's tables and figures as rows, each measured beside the paper's own way and VTK.
#pragma once

#include <cstdint>
#include <span>

#include "tests/bench/report.h"

namespace isomesh::bench {

// Five against six tetrahedra: the paper's Table 2.
Json measure_schemes(const Subject& subject);
// Vertices against unique ones at several resolutions: the paper's Table 3.
Json measure_unique(const Subject& head, std::span<const std::uint32_t> cubes);
// Time against the number of sub-tables, the paper's way, on one thread, one run each: the paper's
// Figure 4. What takes minutes is left out.
Json measure_sub_tables(const Subject& head, std::span<const std::uint64_t> triangles);
// isomesh and VTK on the first of these meshes, which have no sub-tables.
Json measure_without_sub_tables(const Subject& head, std::uint64_t triangles);
// Generation and smoothing: the paper's Figures 5 and 6.
Json measure_generation(const Subject& head, std::span<const std::uint64_t> triangles);
// Extraction and smoothing with each number of passes.
Json measure_passes(const Subject& subject, std::span<const int> passes);

}  // namespace isomesh::bench
