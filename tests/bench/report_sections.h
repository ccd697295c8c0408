// The sections of the report. Each measures, and writes what it measured beside what the paper
// gives and what VTK takes; what contradicts the paper, or the paper itself, goes to `remarks`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tests/bench/document.h"
#include "tests/bench/ratios.h"
#include "tests/bench/samples.h"
#include "tests/bench/service.h"

namespace isomesh::bench {

// A volume and the surfaces of it that the report looks at.
struct Subject {
  Samples samples;
  struct Level {
    std::string name;
    double iso;
  };
  std::vector<Level> levels;
};

struct Report {
  Document& document;
  std::vector<std::string> remarks;
  int threads = 1;
};

// Five against six tetrahedra: the paper's Table 2.
void write_table_2(const std::vector<Subject>& subjects, Report& report);
// Vertices against unique ones: the paper's Table 3. `head` at its own resolution.
void write_table_3(const Subject& head, Report& report);
// Time against the number of sub-tables: the paper's Figure 4.
void write_figure_4(const Subject& head, Report& report);
// Generation and smoothing: the paper's Figures 5 and 6.
void write_figures_5_and_6(const Subject& head, Report& report);
void write_passes(const Subject& subject, Report& report);
void write_growth(std::span<const std::uint32_t> sizes, Report& report);
// What scheme, interpolation and smoothing do to the mesh.
void write_choices(const std::vector<Subject>& subjects, Report& report);
// Aspect ratios, angles and enclosed volume against passes, Laplacian beside Taubin.
void write_quality(const std::vector<Subject>& subjects, Report& report);
void write_goals(const Plan& plan, Report& report);
// What a daemon reports of its jobs, and how long requests take.
void write_service(const ServicePlan& plan, Report& report);
// Several daemons on one PostgreSQL; left out, saying so, where that is not installed.
void write_cluster(const std::filesystem::path& daemon, Report& report);
// All labels of a segmentation beside the peers. The root: see surface_nets.h.
void write_labels(const std::filesystem::path& surface_nets_root, Report& report);
// A volume at its own resolution, and the surface that is simplified.
struct AccuracySubject {
  const Samples& samples;
  Subject::Level level;
};
// Triangles, distances and times against the bound of the error, beside others' simplification.
void write_accuracy(const std::vector<AccuracySubject>& subjects, Report& report);
// How much of a job is encoding, by libdraco and by our own encoder.
void write_draco_share(const Subject& subject, Report& report);

}  // namespace isomesh::bench
