#include "server/jobs/job_process.h"

#include <array>
#include <cerrno>
#include <chrono>

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/wait.h>

namespace isomesh::jobs {
namespace {

// How long a process that closed its end may take to be gone.
constexpr std::chrono::milliseconds kGone{2000};
// A line of the end has the summary of a mesh.
constexpr std::size_t kLongestLine = std::size_t{16} << 20;

std::string how_it_ended(const std::optional<int>& status) {
  if (!status) return "without an answer";
  if (WIFSIGNALED(*status)) return "by signal " + std::to_string(WTERMSIG(*status));
  return "with status " + std::to_string(WEXITSTATUS(*status));
}

}  // namespace

Job JobProcess::run(const JobOrder& order, const std::stop_token& stop, const Report& report) {
  if (child_ && child_->has_ended()) child_.reset();  // idle, so no job's doing
  if (!child_) {
    child_ = process::start_program(program_);
    heard_.clear();
    child_->say(to_line(setup_));
  }
  is_cancelled_ = false;
  child_->say(to_line(order));
  try {
    while (const auto line = next_line(stop)) {
      JobAnswer answer = answer_from(*line);
      if (answer.error) throw *answer.error;
      if (answer.made) return *std::move(answer.made);
      report(answer.progress->stage, answer.progress->share, answer.progress->timing);
    }
  } catch (const Error& error) {
    // After words that are none of ours nothing of it is believed.
    if (error.code() == ErrorCode::kInternal) child_.reset();
    throw;
  }
  throw_ended();
}

std::optional<std::string> JobProcess::next_line(const std::stop_token& stop) {
  std::array<char, 4096> piece;
  for (;;) {
    if (const std::size_t end = heard_.find('\n'); end != std::string::npos) {
      std::string line = heard_.substr(0, end);
      heard_.erase(0, end + 1);
      return line;
    }
    if (heard_.size() > kLongestLine) return std::nullopt;
    if (stop.stop_requested() && !is_cancelled_) {
      child_->say(kCancelMessage);
      is_cancelled_ = true;
    }
    pollfd waiting = {child_->socket().number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(process::kLook.count())) <= 0) continue;
    const ssize_t count = ::recv(child_->socket().number(), piece.data(), piece.size(), 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return std::nullopt;
    heard_.append(piece.data(), static_cast<std::size_t>(count));
  }
}

void JobProcess::throw_ended() {
  const std::string how = how_it_ended(child_->ended_within(kGone));
  child_.reset();
  spdlog::error("a job's process ended {}", how);
  throw Error(ErrorCode::kInternal, "The process that ran this job ended " + how + ".");
}

}  // namespace isomesh::jobs
