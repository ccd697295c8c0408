#include "client/isomesh/busy.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <random>

#include "client/isomesh/impl.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;

double random_share() {
  thread_local std::minstd_rand source(std::random_device{}());
  return std::uniform_real_distribution<double>(0, 1)(source);
}

bool is_busy(int status) { return status == 429 || status == 503; }

milliseconds share_of(milliseconds whole, double share) {
  return std::chrono::duration_cast<milliseconds>(whole * share);
}

}  // namespace

void pause(milliseconds duration, const std::stop_token& stop) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  const auto never = [] { return false; };
  std::condition_variable_any().wait_for(lock, stop, duration, never);
  if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "interrupted");
}

Waiting Waiting::real() {
  Waiting waiting;
  waiting.random = random_share;
  return waiting;
}

std::optional<milliseconds> BusyWait::next_pause(std::chrono::seconds retry_after) {
  const Waiting::Clock::time_point now = waiting_.now();
  if (!refused_at_) refused_at_ = now;
  const milliseconds pause = pause_after(retry_after);
  if (now - *refused_at_ + pause > limit_) return std::nullopt;
  return pause;
}

milliseconds BusyWait::pause_after(std::chrono::seconds retry_after) {
  if (retry_after.count() > 0) {
    const milliseconds asked = retry_after;
    return asked + share_of(std::max(asked / 4, kLeastJitter), waiting_.random());
  }
  const milliseconds whole = backoff_.next();
  return whole / 2 + share_of(whole / 2, waiting_.random());
}

HttpResponse PersistentTransport::send(const HttpRequest& request,
                                       const std::function<void(milliseconds)>& excuse) const {
  BusyWait wait(options_.retry_timeout, options_.waiting);
  while (true) {
    HttpResponse response = transport_.send(request);
    if (!is_busy(response.status)) return response;
    const std::optional<milliseconds> duration = wait.next_pause(response.retry_after);
    if (!duration) return response;
    if (options_.busy) options_.busy(refusal(response), *duration);
    if (excuse) excuse(*duration);
    options_.waiting.pause(*duration, options_.stop);
  }
}

}  // namespace isomesh
