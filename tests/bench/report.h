// The report: the paper's tables and figures, measured again.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace isomesh::bench {

// Measures for some minutes, on two threads or as many as the machine has, and writes REPORT.md and
// the plots beside it into `folder`, which is made when it is missing. A volume that is not
// installed is left out, and the report says so. `daemon` is the program isomeshd;
// `surface_nets_root` may be empty, see surface_nets.h. Of `only` as many sections as are named are
// written, all where none is. Returns the exit status. Throws std::runtime_error when a file cannot
// be written.
int write_report(const std::filesystem::path& folder, const std::filesystem::path& daemon,
                 const std::filesystem::path& surface_nets_root,
                 const std::vector<std::string>& only);

// What sections are called.
inline constexpr std::array<const char*, 9> kReportSections = {
    "service", "cluster", "goals", "paper", "passes", "growth", "quality", "labels", "accuracy"};

}  // namespace isomesh::bench
