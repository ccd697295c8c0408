// The measurements of the report: the paper's tables and figures, measured again. report.py makes
// Markdown and figures of them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/rows.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// A volume and the surfaces of it that the report looks at.
struct Subject {
  Samples samples;
  struct Level {
    std::string name;
    double iso = 0;
  };
  std::vector<Level> levels;
};

// Name of a surface in the report: the volume's name and size, and the level.
std::string title_of(const Samples& samples, const Subject::Level& level);

inline constexpr std::array kReportSections = {"service", "goals",    "paper",  "passes",
                                               "quality", "lattices", "growth", "accuracy"};

struct ReportPlan {
  std::vector<std::string> sections;  // of kReportSections; empty: all
  int threads = 2;
  std::filesystem::path daemon;      // isomeshd, for the section `service`
  std::filesystem::path brain_file;  // what it is given
  // Sections that need a volume which is missing are left out.
  std::optional<Subject> head;  // resampled to cubes
  std::optional<Subject> brain;
  std::vector<std::uint32_t> cubes = {32, 64, 128};  // ascending; most sections use the last
  std::vector<std::uint32_t> growth = {64, 96, 128, 192, 256, 384, 512};
  std::vector<std::uint64_t> paper_triangles = {337'863, 71'795};  // of the paper's two meshes
};

// With the volumes of Debian's packages invesalius-examples and mricron-data that are installed.
ReportPlan usual_plan(const std::filesystem::path& daemon);

// Takes some minutes; says on standard error what it is doing. Times are medians unless report.py
// says otherwise. Throws what the sections' measurements throw.
Json measure_report(const ReportPlan& plan);

}  // namespace isomesh::bench
