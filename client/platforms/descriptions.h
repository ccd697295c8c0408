// Descriptions of `isomesh local` for platforms. Private to this folder.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::cli {

struct ToolOption {
  std::string name;  // "max-error", without hyphens
  std::string help;
  bool is_flag = false;
  bool is_repeated = false;  // takes several values, each after its name
};

struct ToolTable {
  std::string image;  // of the container
  std::vector<ToolOption> options;
};

struct Platform {
  std::string_view name;
  std::string_view title;
  std::string (*describe)(const ToolTable& table);
};

std::string cwl_of(const ToolTable& table);
std::string xnat_of(const ToolTable& table);
std::string snakemake_of(const ToolTable& table);
std::string nextflow_of(const ToolTable& table);
std::string bids_of(const ToolTable& table);

inline constexpr std::array kPlatforms = {
    Platform{"cwl", "a tool in the Common Workflow Language 1.2", cwl_of},
    Platform{"xnat", "command.json for XNAT's container service", xnat_of},
    Platform{"snakemake", "a Snakefile with one rule", snakemake_of},
    Platform{"nextflow", "a process in Nextflow's DSL 2", nextflow_of},
    Platform{"bids", "a BIDS App, as a Python program", bids_of}};

}  // namespace isomesh::cli
