// Imports that run apart: in a process that may do little else than read the one file.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <filesystem>
#include <mutex>
#include <stop_token>

#include "server/volume/import.h"
#include "server/volume/import_message.h"

namespace isomesh::volume {

struct RunnerOptions {
  ImportBounds bounds;
  std::size_t at_once = 2;  // further imports wait for their turn
  // The program to start; empty: this process's own, whose main() must have called
  // become_import_worker_if_asked.
  std::filesystem::path program;
};

// Thread safe.
class ImportRunner {
 public:
  explicit ImportRunner(const RunnerOptions& options);

  // As import_volume, in a process of its own. Whatever becomes of that process: this returns or
  // throws, and nothing of it is left but files in the scratch folder. Throws also Error
  // kUnusableVolume when the process crashed or took longer or more than it may, kUnavailable once
  // stopped. What it returns has been checked against the canonical file.
  Volume run(const ImportTask& task);

  // Ends all imports, those that wait and those that come.
  void stop();

 private:
  void take_place();
  void give_place_back();

  const RunnerOptions options_;
  std::stop_source stop_;
  std::mutex mutex_;
  std::condition_variable_any place_free_;
  std::size_t running_ = 0;
};

}  // namespace isomesh::volume
