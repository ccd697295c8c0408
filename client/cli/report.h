// What the command says about jobs and volumes. Pure functions: values in, lines of text out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "proto/types.h"

namespace isomesh::cli {

// What the client saw of a job's way, beside what the server measured; milliseconds.
struct ClientTiming {
  std::optional<double> upload = {};
  std::optional<double> download = {};
};

// The stages with their times and their shares of the total, transfers around them.
std::string timing_report(const Timing& timing, const ClientTiming& client);

std::string mesh_report(const MeshSummary& mesh);
std::string volume_report(const Volume& volume);
// A line of bars under the range; their heights are logarithms, because air outnumbers everything.
std::string histogram_report(const Histogram& histogram);
std::string estimate_report(const Estimate& estimate);
std::string job_report(const Job& job);

// What to add to the command so that it is not refused: a line for each choice. Empty without one.
std::string remedy_report(const Remedy& remedy);

// One line each under a heading.
std::string job_list(const std::vector<Job>& jobs);
std::string volume_list(const std::vector<Volume>& volumes);
std::string label_list(const VolumeLabels& labels);

// The job as the server's JSON, with what the client adds: `outputs`, the files that were written,
// and `client`, with `upload` and `download` in milliseconds.
std::string job_json(const Job& job, const std::vector<std::filesystem::path>& outputs,
                     const ClientTiming& client);

}  // namespace isomesh::cli
