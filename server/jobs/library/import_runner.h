// Runs each import in a sandboxed process of its own, which can read little but its one file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "server/import/message/import_message.h"
#include "server/jobs/library/import_places.h"
#include "server/process/prepared.h"

namespace isomesh::jobs {

using import::ImportBounds;
using import::ImportOptions;
using import::ImportReport;
using import::ImportTask;
using import::PeersResponse;
using import::PeersSeries;

struct RunnerOptions {
  ImportBounds bounds;
  // Further imports wait; also the number of idle processes kept ready.
  std::size_t at_once = 2;
  process::Program program;  // isomesh-import
};

// The bounds of one import: at most `most`, and less time for a small upload, which takes long only
// if it is malicious. Honest uploads are read at many megabytes per second.
ImportBounds bounds_for(std::uint64_t upload_bytes, const ImportBounds& most);

// The process was ended because it took too long. The text says after how long, and what to do.
class ImportTookTooLong : public Error {
 public:
  explicit ImportTookTooLong(const std::string& text) : Error(ErrorCode::kUnusableVolume, text) {}
};

[[noreturn]] void throw_cancelled();
[[noreturn]] void throw_ending();

// Thread safe.
class ImportRunner {
 public:
  explicit ImportRunner(const RunnerOptions& options);

  // Imports as import_volume does, in a process used for this import only. `party` is whose turn it
  // is (ImportPlaces). The process has ended
  // when this returns or throws, and leaves files only in the scratch folder. The returned volume
  // has been compared with the canonical file. Throws what import_volume throws; Error
  // kUnusableVolume if the process crashes or exceeds its bounds, as ImportTookTooLong if it took
  // too long; kUnavailable after stop(); kCancelled after a stop request to `cancelled`.
  Volume run(const ImportTask& task, const std::string& party = {},
             const std::stop_token& cancelled = {});

  // Reads a peer's response from `file` in such a process. Throws Error kInvalidParameter if it is
  // malformed; otherwise as run() does.
  PeersResponse read_response(const std::filesystem::path& file);

  // Calls `run` with a token that stop() and `cancelled` stop, and returns its result. If it throws
  // an Error after that, throws as run() does.
  template <class Run>
  auto until_stopped(const std::stop_token& cancelled, const Run& run) const {
    std::stop_source stop;
    const auto request_stop = [&stop] { stop.request_stop(); };
    const std::stop_callback on_end(stop_.get_token(), request_stop);
    const std::stop_callback on_cancel(cancelled, request_stop);
    try {
      return run(stop.get_token());
    } catch (const Error&) {
      if (cancelled.stop_requested()) throw_cancelled();
      if (stop_.stop_requested()) throw_ending();
      throw;
    }
  }

  // Aborts running and waiting imports, and rejects further ones.
  void stop();

 private:
  // Sends `message` to a process and returns its report. The process has ended when this returns.
  // Throws as run() does if the report has neither a result nor an error.
  ImportReport report_of(const std::string& message, const ImportBounds& bounds,
                         const std::string& party, const std::stop_token& stop);
  // Returns nothing if the process ended before it began its work.
  std::optional<ImportReport> run_in(process::Child child, const std::string& message,
                                     const ImportBounds& bounds, const std::stop_token& stop);

  const RunnerOptions options_;
  std::stop_source stop_;
  ImportPlaces places_;
  process::PreparedProcesses prepared_;
};

}  // namespace isomesh::jobs
