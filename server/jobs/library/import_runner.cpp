#include "server/jobs/library/import_runner.h"

#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "proto/error.h"
#include "server/jobs/limits.h"
#include "server/process/sandbox.h"
#include "server/volume/canonical.h"
#include "server/volume/labels.h"
#include "server/volume/unusable.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

std::string while_reading(const ImportReport& report) {
  return report.reading.empty() ? "" : " while reading " + report.reading;
}

// `limit` as in "20 seconds of processor time"; `advice` is a sentence.
[[noreturn]] void refuse_slow(const std::string& limit, const std::string& advice,
                              const ImportReport& report) {
  const std::string what =
      "The import took too long: it ended after " + limit + while_reading(report);
  log_error("{}", what);
  throw ImportTookTooLong(what + ". " + advice);
}

// A small upload has less time than others.
[[noreturn]] void refuse_busy(std::chrono::seconds time, std::chrono::seconds most,
                              const ImportReport& report) {
  const std::string advice =
      time < most
          ? "That is the limit for an upload of this size. If the file is compressed, send it "
            "uncompressed: a larger upload has more time."
          : "Send a smaller file, or have the server allow more time (--import-seconds).";
  refuse_slow(std::to_string(time.count()) + " seconds of processor time", advice, report);
}

[[noreturn]] void refuse_dead(const std::string& how, const ImportReport& report) {
  const std::string what = "The import ended " + how + while_reading(report);
  log_error("{}", what);
  volume::throw_unusable(what + "; the file is damaged or malicious.");
}

[[noreturn]] void throw_lying() {
  throw Error(ErrorCode::kInternal, "An import's response does not match its canonical file.");
}

bool are_axis_codes(std::string_view text) {
  return text.size() == 3 && text.find_first_not_of("RLAPSI") == std::string_view::npos;
}

// A malicious file may have taken over the process, so its response is compared with the canonical
// file.
void check(const Volume& volume, const ImportTask& task) {
  if (!std::filesystem::exists(task.target)) throw_lying();
  for (const Note& note : volume.notes) {
    if (find_note(note.code) == nullptr) throw_lying();
  }
  if (!volume::is_label_table(volume.labels)) throw_lying();
  if (volume.stored_axes && !are_axis_codes(*volume.stored_axes)) throw_lying();
  const volume::CanonicalFile canonical(task.target);
  const volume::CanonicalHeader& header = canonical.header();
  const auto [low, high] = volume.range;
  if (header.dims != volume.dims || header.type != volume.type ||
      header.geometry != volume.geometry || header.sample_bytes() != volume.bytes ||
      volume.bytes > task.limits.max_sample_bytes || !(low <= high) || !std::isfinite(low) ||
      !std::isfinite(high) || !std::isfinite(volume.suggested_iso)) {
    throw_lying();
  }
}

Volume volume_of(ImportReport report, const ImportTask& task) {
  if (report.error) {
    log_info("an import was rejected{}: {}", while_reading(report),
             describe(report.error->code()).name);
    throw *report.error;
  }
  if (!report.volume) throw_lying();
  check(*report.volume, task);
  report.volume->id.clear();
  report.volume->created.clear();
  return *std::move(report.volume);
}

// 0 if the file is missing; the import reports that error.
std::uint64_t size_of(const std::filesystem::path& upload) {
  std::error_code absent;
  const std::uintmax_t bytes = std::filesystem::file_size(upload, absent);
  return absent ? 0 : bytes;
}

}  // namespace

ImportBounds bounds_for(std::uint64_t upload_bytes, const ImportBounds& most) {
  const std::chrono::seconds usual =
      limits::kLeastImportTime + std::chrono::seconds(upload_bytes / limits::kImportBytesPerSecond);
  ImportBounds bounds = most;
  bounds.time = std::min(usual, std::max(most.time, std::chrono::seconds(0)));
  return bounds;
}

ImportRunner::ImportRunner(const RunnerOptions& options)
    : options_(options), places_(options.at_once), prepared_(options.program, options.at_once) {
  if (!process::has_landlock()) {
    log_warning("this kernel has no Landlock: imports and jobs could read this user's files");
  }
}

void throw_cancelled() { throw Error(ErrorCode::kCancelled, "the upload was cancelled"); }

void throw_ending() { throw Error(ErrorCode::kUnavailable, "the service is shutting down"); }

Volume ImportRunner::run(const ImportTask& task, const std::string& party,
                         const std::stop_token& cancelled) {
  // Checked here because a JSON message cannot carry non-finite numbers.
  if (task.options.raw) volume::check_raw(*task.options.raw, task.limits);
  const ImportBounds bounds = bounds_for(size_of(task.source), options_.bounds);
  const std::string message = import::to_message(import::ImportOrder{task, bounds});
  return until_stopped(cancelled, [&](const std::stop_token& stop) {
    return volume_of(report_of(message, bounds, party, stop), task);
  });
}

PeersResponse ImportRunner::read_response(const std::filesystem::path& file) {
  const ImportBounds bounds = bounds_for(size_of(file), options_.bounds);
  ImportReport report = until_stopped({}, [&](const std::stop_token& stop) {
    return report_of(import::to_message(import::ResponseOrder{{file}, bounds}), bounds, "", stop);
  });
  if (report.error) throw *report.error;
  if (!report.response) throw_lying();
  return *std::move(report.response);
}

ImportReport ImportRunner::report_of(const std::string& message, const ImportBounds& bounds,
                                     const std::string& party, const std::stop_token& stop) {
  const ImportPlaces::Place place = places_.take(party, stop);
  const auto deadline = Clock::now() + options_.bounds.time;
  // A process that died while idle has not touched the file. Several in a row are a defect.
  for (int tries = 0; tries < limits::kMostIdleDeaths; ++tries) {
    if (auto report = run_in(prepared_.take(deadline, stop), message, bounds, stop))
      return *std::move(report);
    log_warning("a prepared import process ended before its import began; another one takes over");
  }
  throw Error(ErrorCode::kInternal, "Import processes end before their imports begin.");
}

std::optional<ImportReport> ImportRunner::run_in(process::Child child, const std::string& message,
                                                 const ImportBounds& bounds,
                                                 const std::stop_token& stop) {
  using Ending = process::Output::Ending;
  child.send_last(message);
  const auto deadline = Clock::now() + options_.bounds.time;
  const process::Output output = child.receive(limits::kMostImportMessages, deadline, stop);
  if (output.ending == Ending::kStopped) throw_ending();
  ImportReport report = import::report_from(output.text);
  if (output.ending == Ending::kTooLong) {
    refuse_slow(std::to_string(options_.bounds.time.count()) + " seconds",
                "Send it again when the server has less to do, or have the server allow more time "
                "(--import-seconds).",
                report);
  }
  const bool is_answered = report.volume || report.response || report.error;
  if (output.ending == Ending::kTooMuch || !is_answered) {
    const auto status = child.ended_within(limits::kExit);
    if (output.ending == Ending::kClosed && !report.begun) return std::nullopt;
    prepared_.renew();
    if (process::is_out_of_time(status)) refuse_busy(bounds.time, options_.bounds.time, report);
    refuse_dead(process::how_it_ended(status), report);
  }
  // The process must have ended before the file is checked; otherwise it could still change the
  // file.
  child.end();
  return report;
}

void ImportRunner::stop() {
  stop_.request_stop();
  prepared_.stop();
}

}  // namespace isomesh::jobs
