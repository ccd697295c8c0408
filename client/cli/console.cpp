#include "client/cli/console.h"

#include <atomic>
#include <chrono>
#include <iostream>
#include <mutex>

#include <unistd.h>

#include "base/text.h"
#include "client/cli/option_groups.h"
#include "client/cli/report.h"
#include "client/cli/text.h"
#include "proto/notes.h"

namespace isomesh::cli {
namespace {

std::mutex& console_mutex() {
  static std::mutex mutex;
  return mutex;
}

// A person sees why nothing happens. Once, because with --jobs many requests wait.
void tell_wait(const Error& reason, int seconds) {
  static std::atomic<bool> is_told = false;
  if (::isatty(STDERR_FILENO) != 1 || is_told.exchange(true)) return;
  // The line of a progress bar may be there.
  std::cerr << "\r\x1b[K";
  complain("the server is busy (" + std::string(reason.what()) + "); trying again for up to " +
           human_duration(1000.0 * seconds));
}

bool is_busy(const Error& error) {
  return error.code() == ErrorCode::kTooManyRequests || error.code() == ErrorCode::kUnavailable;
}

}  // namespace

Client client_of(const Options& options, const std::stop_token& stop) {
  ClientOptions client{.server = options.server,
                       .token = options.token,
                       .authorities = options.authorities,
                       .retry_timeout = std::chrono::seconds(options.retry_seconds),
                       .stop = stop};
  if (!options.quiet) {
    client.busy = [seconds = options.retry_seconds](const Error& reason,
                                                    std::chrono::milliseconds) {
      tell_wait(reason, seconds);
    };
  }
  return Client(std::move(client));
}

Client parting_client(const Options& options) {
  return Client({.server = options.server,
                 .token = options.token,
                 .authorities = options.authorities,
                 .connect_timeout = std::chrono::seconds{2},
                 .silence_timeout = std::chrono::seconds{5},
                 .retry_timeout = std::chrono::seconds{2}});
}

void print(const std::string& lines) {
  const std::scoped_lock lock(console_mutex());
  std::cout << printable_lines(lines) << std::flush;
}

void print_json(const std::string& json) {
  const std::scoped_lock lock(console_mutex());
  std::cout << with_escapes(json) << '\n' << std::flush;
}

void remark(const std::string& line) {
  const std::scoped_lock lock(console_mutex());
  std::cerr << printable_lines(line) << '\n';
}

void tell_next(const std::string& command, const std::string& cursor) {
  if (!cursor.empty()) remark("More: " + command + " --cursor " + shell_word(cursor));
}

void complain(const std::string& message) { remark("isomesh: " + message); }

void complain(const Error& error, const std::string& subject) {
  const std::string remedy = remedy_report(error.remedy());
  std::string text = subject + (subject.empty() ? "" : ": ") + in_options(error);
  if (is_busy(error)) text += "; try again later, or wait longer with --retry-seconds";
  if (!remedy.empty()) text += '\n' + remedy.substr(0, remedy.size() - 1);
  complain(text);
}

void suggest_local() {
  complain("check --server, start isomeshd, or use `isomesh local`, which needs no server");
}

void tell_notes(const std::vector<Note>& notes, const Options& options,
                const std::string& subject) {
  if (options.quiet) return;
  for (const Note& note : notes) {
    // It advises --labels, which is given.
    const bool is_followed = note.code == describe(NoteCode::kLooksLikeLabels).name;
    if (is_followed && options.parameters.labels) continue;
    complain((subject.empty() ? "" : subject + ": ") + "note: " + with_options(note.detail) + " (" +
             note.code + ")");
  }
}

}  // namespace isomesh::cli
