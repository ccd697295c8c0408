// Runs each import in a process of its own, which may do little else than read the one file.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stop_token>

#include "server/process/import_message.h"
#include "server/process/prepared.h"

namespace isomesh::jobs {

struct RunnerOptions {
  process::ImportBounds bounds;
  std::size_t at_once = 2;        // further imports wait; so many processes are kept prepared
  std::filesystem::path program;  // isomesh-import
};

// The bounds of one import: no more than `most`, and less processor time for a small upload, which
// takes long only when it is made to. What is small unpacked is read at many megabytes a second.
process::ImportBounds bounds_for(std::uint64_t upload_bytes, const process::ImportBounds& most);

// Thread safe.
class ImportRunner {
 public:
  explicit ImportRunner(const RunnerOptions& options);

  // Imports as import_volume does, in a process that does nothing else, before or after, and has
  // ended when this returns or throws; only files in the scratch folder may remain of it. Throws
  // what import_volume throws, and Error kUnusableVolume when the process crashes or exceeds its
  // bounds, kUnavailable once stopped. The volume has been compared with the canonical file.
  Volume run(const process::ImportTask& task);

  // Ends the imports that run or wait, and refuses further ones.
  void stop();

 private:
  // Empty when the process had ended before it began.
  std::optional<Volume> run_in(process::Child child, const process::ImportTask& task);
  void take_place();
  void give_place_back();

  const RunnerOptions options_;
  std::stop_source stop_;
  std::mutex mutex_;
  std::condition_variable_any place_free_;
  std::size_t running_ = 0;
  process::PreparedProcesses prepared_;
};

}  // namespace isomesh::jobs
