// From one input to the files of its meshes; private to this folder.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/batch.h"
#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/cli/report.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

// The volumes that a dry run has stored. They are deleted when all inputs have ended, because
// several inputs may be the same volume. Thread safe.
class Leftovers {
 public:
  explicit Leftovers(const Options& options) : options_(options) {}
  ~Leftovers();
  Leftovers(const Leftovers&) = delete;
  Leftovers& operator=(const Leftovers&) = delete;

  void add(const std::vector<UploadedVolume>& uploaded);

 private:
  const Options& options_;
  std::mutex mutex_;
  std::set<std::string> ids_;
};

// Writes to standard output. Thread safe.
void print(const std::string& text);

// Processes one input at a time: uploads it, meshes it and downloads the mesh. One object per
// thread.
class MeshRun {
 public:
  MeshRun(const Options& options, const std::stop_token& stop, bool is_one_of_many,
          TakenOutputs& taken, Leftovers& leftovers);

  // Returns the exit status. Throws Error as Client does, and Lost.
  int input(const Input& input);

 private:
  // One mesh of an input. `subject` begins messages; empty if there is only one.
  struct Task {
    OutputNames names;
    Origin origin;
    std::string subject;
  };

  int members(const Input& input, std::vector<UploadedVolume> volumes);
  int stored(const std::string& id, const Input& input);
  Task task_of(const Input& input) const;
  Task task_of(const Input& input, const OutputNames& names, const std::string& member) const;
  int mesh(const Volume& volume, const Task& task);
  std::optional<Job> made(const JobParameters& parameters);
  void resumable(const std::string& job, const std::function<void()>& step);
  int dry_run(const JobParameters& parameters, const Task& task);
  void report(const Job& job, const std::vector<Output>& outputs, const Task& task);

  const Options& options_;
  const std::stop_token stop_;
  TakenOutputs& taken_;
  Leftovers& leftovers_;
  const bool is_one_of_many_;
  Client client_;
  ProgressBar bar_;
  ClientTiming seen_;
};

}  // namespace isomesh::cli
