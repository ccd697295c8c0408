#include "server/jobs/import_runner.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "proto/error.h"
#include "server/process/sandbox.h"
#include "server/volume/canonical.h"
#include "server/volume/unusable.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kLook{100};  // between two looks at the stop token
constexpr milliseconds kEnd{2000};  // how long a process may go on after it has closed its end
constexpr std::size_t kMostAnswerBytes = std::size_t{16} << 20;

// --- Starting ------------------------------------------------------------------------------------

void require_spawn(int error, std::string_view call) {
  if (error != 0) throw_system_error(call, error);
}

// Starts a process that inherits nothing of this one: one end of the socket is its only descriptor,
// its environment is empty, and its signals have their defaults.
class Inheritance {
 public:
  explicit Inheritance(int pipe) {
    require_spawn(::posix_spawn_file_actions_init(&files_), "posix_spawn_file_actions_init");
    require_spawn(::posix_spawnattr_init(&attributes_), "posix_spawnattr_init");
    // The socket is duplicated first, because the next actions may close its old number.
    add(::posix_spawn_file_actions_adddup2(&files_, pipe, process::kImportDescriptor));
    for (int standard = 0; standard < process::kImportDescriptor; ++standard) {
      add(::posix_spawn_file_actions_addopen(&files_, standard, "/dev/null", O_RDWR, 0));
    }
    add(::posix_spawn_file_actions_addclosefrom_np(&files_, process::kImportDescriptor + 1));
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes_, &none);
    ::posix_spawnattr_setsigdefault(&attributes_, &all);
    ::posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~Inheritance() {
    ::posix_spawn_file_actions_destroy(&files_);
    ::posix_spawnattr_destroy(&attributes_);
  }
  Inheritance(const Inheritance&) = delete;
  Inheritance& operator=(const Inheritance&) = delete;

  pid_t start(const std::filesystem::path& program) const {
    std::string name = "isomesh-import";
    const std::array<char*, 2> arguments = {name.data(), nullptr};
    const std::array<char*, 1> environment = {nullptr};
    pid_t pid = -1;
    require_spawn(::posix_spawn(&pid, program.c_str(), &files_, &attributes_, arguments.data(),
                                environment.data()),
                  "posix_spawn");
    return pid;
  }

 private:
  static void add(int error) { require_spawn(error, "posix_spawn_file_actions_add"); }

  posix_spawn_file_actions_t files_;
  posix_spawnattr_t attributes_;
};

// A process that is killed and waited for at the end of this object's life.
class Process {
 public:
  explicit Process(pid_t pid) : pid_(pid) {}
  ~Process() { end(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Its status, if it ends by itself within that time.
  std::optional<int> ended_within(milliseconds longest) {
    constexpr milliseconds kStep{2};
    for (const auto until = Clock::now() + longest;;) {
      if (reap(WNOHANG)) return status_;
      if (Clock::now() >= until) return std::nullopt;
      std::this_thread::sleep_for(kStep);
    }
  }

  void end() {
    if (reaped_) return;
    ::kill(pid_, SIGKILL);
    reap(0);
  }

 private:
  bool reap(int flags) {
    if (reaped_) return true;
    pid_t found = 0;
    do {
      found = ::waitpid(pid_, &status_, flags);
    } while (found < 0 && errno == EINTR);
    return reaped_ = found != 0;
  }

  pid_t pid_;
  int status_ = 0;
  bool reaped_ = false;
};

struct Pipe {
  Descriptor ours;
  Descriptor theirs;
};

Pipe make_pipe() {
  std::array<int, 2> ends = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw_system_error("socketpair", errno);
  }
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

// --- Talking -------------------------------------------------------------------------------------

// An error is no matter here: a process that has ended is noticed when its answer is read.
void send(const Descriptor& pipe, std::string_view message) {
  while (!message.empty()) {
    const ssize_t count = ::send(pipe.number(), message.data(), message.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return;
    message.remove_prefix(static_cast<std::size_t>(count));
  }
  ::shutdown(pipe.number(), SHUT_WR);
}

enum class Ending { kClosed, kTooLong, kTooMuch, kStopped };

struct Heard {
  Ending ending = Ending::kClosed;
  std::string text;
};

Heard listen(const Descriptor& pipe, Clock::time_point deadline, const std::stop_token& stop) {
  Heard heard;
  std::array<char, 4096> piece;
  for (;;) {
    if (stop.stop_requested()) return {Ending::kStopped, {}};
    if (Clock::now() >= deadline) return {Ending::kTooLong, std::move(heard.text)};
    if (heard.text.size() > kMostAnswerBytes) return {Ending::kTooMuch, {}};
    pollfd waiting = {pipe.number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(kLook.count())) <= 0) continue;
    const ssize_t count = ::read(pipe.number(), piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return heard;
    heard.text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

// --- Judging -------------------------------------------------------------------------------------

std::string while_reading(const process::ImportReport& report) {
  return report.reading.empty() ? "" : " while reading " + report.reading;
}

std::string how_it_ended(const std::optional<int>& status) {
  if (!status) return "without an answer";
  if (WIFSIGNALED(*status)) return "by signal " + std::to_string(WTERMSIG(*status));
  return "with status " + std::to_string(WEXITSTATUS(*status));
}

[[noreturn]] void refuse_dead(const std::string& how, const process::ImportReport& report) {
  const std::string what = "The import ended " + how + while_reading(report);
  spdlog::error("{}", what);
  volume::throw_unusable(what + "; the file is damaged, or made to do harm.");
}

[[noreturn]] void throw_lying() {
  throw Error(ErrorCode::kInternal, "An import's answer is not what its canonical file holds.");
}

// The process may have been taken over by the file that it read, so its answer is compared with the
// canonical file.
void check(const Volume& volume, const process::ImportTask& task) {
  if (!std::filesystem::exists(task.target)) throw_lying();
  const volume::CanonicalVolume canonical(task.target);
  const volume::CanonicalHeader& header = canonical.header();
  const auto [low, high] = volume.range;
  if (header.dims != volume.dims || header.type != volume.type ||
      header.geometry != volume.geometry || header.sample_bytes() != volume.bytes ||
      volume.bytes > task.limits.max_sample_bytes || !(low <= high) || !std::isfinite(low) ||
      !std::isfinite(high) || !std::isfinite(volume.suggested_iso)) {
    throw_lying();
  }
}

Volume volume_of(process::ImportReport report, const process::ImportTask& task) {
  if (report.error) {
    spdlog::info("an import was refused{}: {}", while_reading(report),
                 describe(report.error->code()).name);
    throw *report.error;
  }
  check(*report.volume, task);
  report.volume->id.clear();
  report.volume->created.clear();
  return *std::move(report.volume);
}

}  // namespace

ImportRunner::ImportRunner(const RunnerOptions& options) : options_(options) {
  if (!process::has_landlock()) {
    spdlog::warn("this kernel has no Landlock: imports could read files of this user");
  }
}

Volume ImportRunner::run(const process::ImportTask& task) {
  // Checked here, because a message of JSON cannot carry numbers that are not finite.
  if (task.options.raw) volume::check_raw(*task.options.raw, task.limits);
  take_place();
  const struct Leave {
    ImportRunner& runner;
    ~Leave() { runner.give_place_back(); }
  } leave{*this};

  Pipe pipe = make_pipe();
  Process process(Inheritance(pipe.theirs.number()).start(options_.program));
  pipe.theirs = Descriptor();
  send(pipe.ours, process::to_message({task, options_.bounds}));
  const auto deadline = Clock::now() + options_.bounds.time;
  const Heard heard = listen(pipe.ours, deadline, stop_.get_token());
  if (heard.ending == Ending::kStopped) {
    throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  }
  process::ImportReport report = process::report_from(heard.text);
  if (heard.ending == Ending::kTooLong) {
    refuse_dead("after " + std::to_string(options_.bounds.time.count()) + " seconds", report);
  }
  if (heard.ending == Ending::kTooMuch || (!report.volume && !report.error)) {
    refuse_dead(how_it_ended(process.ended_within(kEnd)), report);
  }
  // Ended before the file is checked, so that nothing can change it afterwards.
  process.end();
  return volume_of(std::move(report), task);
}

void ImportRunner::stop() { stop_.request_stop(); }

void ImportRunner::take_place() {
  std::unique_lock lock(mutex_);
  const bool free =
      place_free_.wait(lock, stop_.get_token(), [&] { return running_ < options_.at_once; });
  if (!free || stop_.stop_requested()) {
    throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  }
  ++running_;
}

void ImportRunner::give_place_back() {
  const std::scoped_lock lock(mutex_);
  --running_;
  place_free_.notify_one();
}

}  // namespace isomesh::jobs
