#include "server/jobs/queue/job_process.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include <poll.h>
#include <sys/socket.h>

#include "base/files.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/jobs/limits.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

// Longer than most lines, and large enough for efficient reading of files.
constexpr std::size_t kReceivedBytes = std::size_t{256} << 10;

}  // namespace

struct JobProcess::Talk {
  const JobOrder& order;
  std::span<const codec::Sink> sinks;
  const std::stop_token& stop;
  const Report& report;
  std::optional<Stage> stage = {};              // none until the process reports one
  std::exception_ptr failure = {};              // exception thrown by a sink or the report
  std::optional<Clock::time_point> asked = {};  // when the process was asked to stop
};

JobProcess::JobProcess(const JobProgram& program) : program_(program) {}

MadeMesh JobProcess::make(const JobOrder& order, std::span<const codec::Sink> sinks,
                          const std::stop_token& stop, const Report& report) {
  return std::get<MadeMesh>(end_of(order, sinks, stop, report));
}

CountedSurface JobProcess::count(const JobOrder& order, const std::stop_token& stop) {
  const Report nobody = [](Stage, double, const Timing&) {};
  return std::get<CountedSurface>(end_of(order, {}, stop, nobody));
}

JobAnswer JobProcess::end_of(const JobOrder& order, std::span<const codec::Sink> sinks,
                             const std::stop_token& stop, const Report& report) {
  if (begin_ == end_ &&
      received_.size() > kReceivedBytes) {  // free the memory of an unusually long line
    received_.resize(kReceivedBytes);
    received_.shrink_to_fit();
    begin_ = end_ = 0;
  }
  const InputFile file(order.file);
  for (int tries = 0; tries < limits::kMostIdleDeaths; ++tries) {
    start();
    Talk talk = {order, sinks, stop, report};
    try {
      child_->send(to_line(order), file.descriptor());
      auto end = follow(talk);
      if (!end) {
        log_warning("a prepared job process ended before its job began; another one takes over");
        child_.reset();
        continue;
      }
      if (talk.failure) std::rethrow_exception(talk.failure);
      // Also if the process finished before it could be asked to stop.
      if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
      if (const auto* const error = std::get_if<Error>(&*end)) throw *error;
      return *std::move(end);
    } catch (const Error& error) {
      // Do not reuse a process after an internal error or a malformed message.
      if (error.code() == ErrorCode::kInternal) child_.reset();
      throw;
    } catch (...) {
      child_.reset();
      throw;
    }
  }
  throw Error(ErrorCode::kInternal, "Job processes end before their jobs begin.");
}

void JobProcess::start() {
  if (child_ && child_->has_ended()) child_.reset();  // it ended while idle, so no job caused it
  if (child_) return;
  received_.resize(std::max(received_.size(), kReceivedBytes));
  child_ = process::start_program(program_.file);
  begin_ = end_ = 0;
  child_->send(to_line(program_.setup));
}

std::optional<JobAnswer> JobProcess::follow(Talk& talk) {
  while (const auto line = next_line(talk)) {
    JobAnswer answer = answer_from(*line);
    const bool is_mesh = talk.order.work == JobOrder::Work::kMesh;
    if (const auto* const progress = std::get_if<JobProgress>(&answer)) {
      pass_on(*progress, talk);
    } else if (const auto* const piece = std::get_if<JobPiece>(&answer)) {
      pass_on(*piece, talk);
    } else if (std::holds_alternative<Error>(answer) ||
               std::holds_alternative<MadeMesh>(answer) == is_mesh) {
      return answer;
    } else {
      throw Error(ErrorCode::kInternal, "A job process answered another request.");
    }
  }
  if (!talk.stage) return std::nullopt;
  throw_ended(talk);
}

void JobProcess::pass_on(const JobProgress& progress, Talk& talk) {
  talk.stage = progress.stage;
  if (talk.failure) return;
  try {
    talk.report(progress.stage, progress.share, progress.timing);
  } catch (...) {
    talk.failure = std::current_exception();
  }
}

void JobProcess::pass_on(const JobPiece& piece, Talk& talk) {
  if (piece.file >= talk.sinks.size()) {
    throw Error(ErrorCode::kInternal, "A job process made a file that was not requested.");
  }
  for (std::size_t left = piece.bytes; left > 0;) {
    if (begin_ == end_ && !hear(talk)) throw_ended(talk);
    const std::size_t count = std::min(left, end_ - begin_);
    const auto bytes = std::as_bytes(std::span(received_).subspan(begin_, count));
    begin_ += count;
    left -= count;
    if (talk.failure) continue;
    try {
      talk.sinks[piece.file](bytes);
    } catch (...) {
      talk.failure = std::current_exception();
    }
  }
}

std::optional<std::string_view> JobProcess::next_line(Talk& talk) {
  std::size_t looked_at = begin_;
  for (;;) {
    const auto from = received_.begin() + static_cast<std::ptrdiff_t>(looked_at);
    const auto to = received_.begin() + static_cast<std::ptrdiff_t>(end_);
    if (const auto found = std::find(from, to, '\n'); found != to) {
      const auto length = static_cast<std::size_t>(found - received_.begin()) - begin_;
      const std::string_view line(received_.data() + begin_, length);
      begin_ += length + 1;
      return line;
    }
    const std::size_t known = end_ - begin_;
    if (known >= limits::kLongestJobMessage) {
      throw Error(ErrorCode::kInternal, "A job process sent too much text.");
    }
    if (known == received_.size()) received_.resize(2 * received_.size());
    if (!hear(talk)) return std::nullopt;
    looked_at = begin_ + known;
  }
}

bool JobProcess::hear(Talk& talk) {
  if (begin_ > 0) {  // only then: otherwise each piece of a long line would move the whole line
    std::copy(received_.begin() + static_cast<std::ptrdiff_t>(begin_),
              received_.begin() + static_cast<std::ptrdiff_t>(end_), received_.begin());
    end_ -= std::exchange(begin_, 0);
  }
  for (;;) {
    look_at_stop(talk);
    pollfd waiting = {child_->socket().number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(process::kLook.count())) <= 0) continue;
    const ssize_t count =
        ::recv(child_->socket().number(), received_.data() + end_, received_.size() - end_, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    end_ += static_cast<std::size_t>(count);
    return true;
  }
}

void JobProcess::look_at_stop(Talk& talk) {
  if (!talk.failure && !talk.stop.stop_requested()) return;
  if (!talk.asked) {
    child_->send(kCancelMessage);
    talk.asked = Clock::now();
  }
  if (Clock::now() - *talk.asked < limits::kStop) return;
  child_.reset();
  if (talk.failure) std::rethrow_exception(talk.failure);
  throw Error(ErrorCode::kCancelled, "cancelled");
}

void JobProcess::throw_ended(const Talk& talk) {
  const std::string how = process::how_it_ended(child_->ended_within(limits::kExit));
  child_.reset();
  const std::string stage(to_string(talk.stage.value_or(Stage::kLoad)));
  if (talk.failure) std::rethrow_exception(talk.failure);
  throw ProcessEnded("The job process ended " + how + " in the stage \"" + stage + "\".");
}

}  // namespace isomesh::jobs
