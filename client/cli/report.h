// The command's texts about jobs and volumes. Pure functions: values in, lines of text out.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/notes.h"
#include "proto/types.h"

namespace isomesh::cli {

// The times of a job that the client measured, in milliseconds. The server measures the others.
struct ClientTiming {
  std::optional<double> upload = {};
  std::optional<double> download = {};
};

inline double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

// The stages with their times and their percentages of the total, with the transfers around them.
std::string timing_report(const Timing& timing, const ClientTiming& client);

// `unit`: of the job's volume.
std::string mesh_report(const MeshSummary& mesh, const LengthUnit& unit = length_unit({}),
                        Inside inside = Inside::kAbove);
std::string volume_report(const Volume& volume);
// A line of bars over the range. Heights are logarithms, because air outnumbers everything else.
std::string histogram_report(const Histogram& histogram);
std::string estimate_report(const Estimate& estimate);
std::string job_report(const Job& job, const LengthUnit& unit = length_unit({}));

// The options that would resolve an error, one per line; empty if there are none.
std::string remedy_report(const Remedy& remedy);

// The names of volumes by their ids; volumes without a name are left out.
using VolumeNames = std::map<std::string, std::string>;

// One line each under a heading. A volume without a name is shown by the beginning of its id.
std::string job_list(const std::vector<Job>& jobs, const VolumeNames& names = {});
std::string volume_list(const std::vector<Volume>& volumes);
std::string label_list(const VolumeLabels& labels);
std::string wall_list(const std::vector<WallSummary>& walls, const LengthUnit& unit);

// The input that a line of JSON is about, in its members `input`, as given on the command line, and
// `member` if it has several volumes. Empty ones are left out.
struct Origin {
  std::string input = {};
  std::string member = {};
};
std::string with_origin(const std::string& json, const Origin& origin);

// The server's JSON of the job. The client adds `outputs`, the files that were written, and
// `client`, with `upload` and `download` in milliseconds.
std::string job_json(const Job& job, const std::vector<std::filesystem::path>& outputs,
                     const ClientTiming& client, const Origin& origin = {});
// `error`: the problem, as in a job that failed.
std::string failure_json(const Error& error, const Origin& origin);
// `skipped` is true, and `outputs` are the files that are newer than the input.
std::string skipped_json(const std::vector<std::filesystem::path>& outputs, const Origin& origin);

}  // namespace isomesh::cli
