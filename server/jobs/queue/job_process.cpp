#include "server/jobs/queue/job_process.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include <poll.h>
#include <sys/socket.h>

#include "base/files.h"
#include "base/log.h"
#include "proto/error.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// How long a process that closed its end may take to be gone.
constexpr milliseconds kGone{2000};
// How long one that was asked to stop may go on: kernels look once per slab, but a stream of
// libdraco's is encoded as a whole.
constexpr milliseconds kPatience{300};
// More than most lines, and enough at once for what is of a file.
constexpr std::size_t kHeardBytes = std::size_t{256} << 10;
// The triangles of 65 535 labels take some 3 MB.
constexpr std::size_t kLongestLine = std::size_t{16} << 20;
// More than one process that ends before it begins is no accident.
constexpr int kMostEarlyEnds = 3;

}  // namespace

// An order under way.
struct JobProcess::Talk {
  const JobOrder& order;
  std::span<const codec::Sink> sinks;
  const std::stop_token& stop;
  const Report& report;
  std::optional<Stage> stage = {};              // none before it began
  std::exception_ptr failure = {};              // of a sink or the report
  std::optional<Clock::time_point> asked = {};  // to stop
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
  if (begin_ == end_ && heard_.size() > kHeardBytes) {  // one long line is no reason to keep it
    heard_.resize(kHeardBytes);
    heard_.shrink_to_fit();
    begin_ = end_ = 0;
  }
  const InputFile file(order.file);
  for (int tries = 0; tries < kMostEarlyEnds; ++tries) {
    start();
    Talk talk = {order, sinks, stop, report};
    try {
      child_->say(to_line(order), file.descriptor());
      auto end = follow(talk);
      if (!end) {
        log_warning("a prepared job process ended before its job began; another one takes over");
        child_.reset();
        continue;
      }
      if (talk.failure) std::rethrow_exception(talk.failure);
      // Also what had ended before it could be told to stop.
      if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
      if (const auto* const error = std::get_if<Error>(&*end)) throw *error;
      return *std::move(end);
    } catch (const Error& error) {
      // After a defect, and after words that are none of ours, nothing of the process is believed.
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
  if (child_ && child_->has_ended()) child_.reset();  // idle, so no job's doing
  if (child_) return;
  heard_.resize(std::max(heard_.size(), kHeardBytes));
  child_ = process::start_program(program_.file);
  begin_ = end_ = 0;
  child_->say(to_line(program_.setup));
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
    const auto bytes = std::as_bytes(std::span(heard_).subspan(begin_, count));
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
    const auto from = heard_.begin() + static_cast<std::ptrdiff_t>(looked_at);
    const auto to = heard_.begin() + static_cast<std::ptrdiff_t>(end_);
    if (const auto found = std::find(from, to, '\n'); found != to) {
      const auto length = static_cast<std::size_t>(found - heard_.begin()) - begin_;
      const std::string_view line(heard_.data() + begin_, length);
      begin_ += length + 1;
      return line;
    }
    const std::size_t known = end_ - begin_;
    if (known >= kLongestLine) {
      throw Error(ErrorCode::kInternal, "A job process sent too much text.");
    }
    if (known == heard_.size()) heard_.resize(2 * heard_.size());
    if (!hear(talk)) return std::nullopt;
    looked_at = begin_ + known;
  }
}

bool JobProcess::hear(Talk& talk) {
  if (begin_ > 0) {  // or a long line that comes in pieces would be moved for each of them
    std::copy(heard_.begin() + static_cast<std::ptrdiff_t>(begin_),
              heard_.begin() + static_cast<std::ptrdiff_t>(end_), heard_.begin());
    end_ -= std::exchange(begin_, 0);
  }
  for (;;) {
    look_at_stop(talk);
    pollfd waiting = {child_->socket().number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(process::kLook.count())) <= 0) continue;
    const ssize_t count =
        ::recv(child_->socket().number(), heard_.data() + end_, heard_.size() - end_, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    end_ += static_cast<std::size_t>(count);
    return true;
  }
}

void JobProcess::look_at_stop(Talk& talk) {
  if (!talk.failure && !talk.stop.stop_requested()) return;
  if (!talk.asked) {
    child_->say(kCancelMessage);
    talk.asked = Clock::now();
  }
  if (Clock::now() - *talk.asked < kPatience) return;
  child_.reset();
  if (talk.failure) std::rethrow_exception(talk.failure);
  throw Error(ErrorCode::kCancelled, "cancelled");
}

void JobProcess::throw_ended(const Talk& talk) {
  const std::string how = process::how_it_ended(child_->ended_within(kGone));
  child_.reset();
  const std::string stage(to_string(talk.stage.value_or(Stage::kLoad)));
  if (talk.failure) std::rethrow_exception(talk.failure);
  throw ProcessEnded("The job process ended " + how + " in the stage \"" + stage + "\".");
}

}  // namespace isomesh::jobs
