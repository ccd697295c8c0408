#include "server/process/prepared.h"

#include <algorithm>
#include <utility>

#include "base/log.h"
#include "proto/error.h"
#include "server/process/fork_server.h"

namespace isomesh::process {
namespace {

using std::chrono::milliseconds;

// Back-off before a failed start is repeated; doubles.
constexpr milliseconds kFirstPause{10};
constexpr milliseconds kLongestPause{1000};

}  // namespace

PreparedProcesses::PreparedProcesses(Program program, std::size_t count)
    : program_(std::move(program)), count_(count), keeper_([this](const std::stop_token& end) {
        keep(stop_.get_token());
        // Keep running: taken children would die with this thread.
        Lock lock(mutex_);
        changed_.wait(lock, end, [] { return false; });
      }) {}

PreparedProcesses::~PreparedProcesses() { stop(); }

Child PreparedProcesses::take(std::chrono::steady_clock::time_point until,
                              const std::stop_token& cancelled) {
  const std::stop_callback wake(cancelled, [this] {
    const Lock lock(mutex_);
    changed_.notify_all();
  });
  Lock lock(mutex_);  // after `wake`, whose end may wait for the callback
  ++takers_;
  for (;;) {
    changed_.notify_all();
    changed_.wait_until(lock, stop_.get_token(), until, [&]() ISOMESH_REQUIRES(mutex_) {
      return !ready_.empty() || cancelled.stop_requested();
    });
    if (stop_.stop_requested() || cancelled.stop_requested() || ready_.empty()) break;
    Child child = std::move(ready_.front());
    ready_.pop_front();
    if (child.has_ended()) continue;
    --takers_;
    changed_.notify_all();
    return child;
  }
  --takers_;
  if (cancelled.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
  throw Error(ErrorCode::kUnavailable, stop_.stop_requested()
                                           ? "the service is shutting down"
                                           : "no process could be started in time");
}

void PreparedProcesses::renew() {
  const Lock lock(mutex_);
  ++generation_;
  ready_.clear();
  changed_.notify_all();
}

void PreparedProcesses::stop() { stop_.request_stop(); }

void PreparedProcesses::keep(const std::stop_token& stop) {
  milliseconds pause = kFirstPause;
  while (!stop.stop_requested()) {
    try {
      prepare_one(stop);
      pause = kFirstPause;
    } catch (const std::exception& error) {
      if (stop.stop_requested()) break;
      log_error("a process could not be prepared and is retried: {}", error.what());
      server_.reset();
      Lock lock(mutex_);
      changed_.wait_for(lock, stop, std::exchange(pause, std::min(2 * pause, kLongestPause)),
                        [] { return false; });
    }
    Lock lock(mutex_);
    changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) {
      return ready_.size() < count_ || takers_ > ready_.size();
    });
  }
  server_.reset();
  const Lock lock(mutex_);
  ready_.clear();
}

void PreparedProcesses::prepare_one(const std::stop_token& stop) {
  std::uint64_t generation = 0;
  {
    const Lock lock(mutex_);
    generation = generation_;
  }
  Child child = copy(generation, stop);
  const Lock lock(mutex_);
  if (generation != generation_) return;  // discard the child of the previous program
  ready_.push_back(std::move(child));
  changed_.notify_all();
}

Child PreparedProcesses::copy(std::uint64_t generation, const std::stop_token& stop) {
  if (!server_ || server_generation_ != generation) {
    server_ = start_program(program_);
    server_generation_ = generation;
  }
  return copy_of(*server_, stop);
}

}  // namespace isomesh::process
