// Runs each import in a process of its own, which may do little else than read the one file.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

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

  // Reads what a PACS has answered, in such a process. Throws Error kPacsUnreachable when it cannot
  // be read, also when the process crashes or exceeds its bounds, kUnavailable once stopped.
  process::PeersAnswer read_answer(const std::filesystem::path& file);

  // Ends the imports that run or wait, and refuses further ones.
  void stop();

 private:
  // What a process says that is told so; it has ended when this returns. Throws as run() does,
  // when it says neither what was asked for nor why there is nothing.
  process::ImportReport report_of(const std::string& message);
  // Empty when the process had ended before it began.
  std::optional<process::ImportReport> run_in(process::Child child, const std::string& message);
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
