#include "server/http/observe/readiness.h"

#include <exception>
#include <utility>

#include "base/log.h"

namespace isomesh::http {
namespace {

constexpr const char* kNothingResponds = "the records or the storage do not respond";

}  // namespace

Readiness::Readiness(std::function<std::string()> check, const Limits& limits)
    : check_(std::move(check)), limits_(limits) {
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

std::string Readiness::reason() {
  Lock lock(mutex_);
  const auto now = Clock::now();
  const bool is_slow = begun_ > ended_ && now - began_at_ > limits_.patience;
  const std::uint64_t wanted = begun_ + 1;
  asked_ = wanted;
  changed_.notify_all();
  // Do not wait for a check that is already late.
  if (!is_slow) {
    changed_.wait_until(lock, now + limits_.patience,
                        [&]() ISOMESH_REQUIRES(mutex_) { return ended_ >= wanted; });
  }
  const bool is_believed = ended_ > 0 && Clock::now() - ended_at_ <= limits_.believed_for;
  return ended_ >= wanted || is_believed ? reason_ : kNothingResponds;
}

void Readiness::work(const std::stop_token& stop) {
  Lock lock(mutex_);
  while (changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) { return asked_ > begun_; })) {
    if (stop.stop_requested()) return;
    ++begun_;
    began_at_ = Clock::now();
    lock.unlock();
    std::string reason;
    try {
      reason = check_();
    } catch (const std::exception& error) {
      log_error("whether the service is ready could not be found out: {}", error.what());
      reason = kNothingResponds;
    }
    lock.lock();
    reason_ = std::move(reason);
    ended_ = begun_;
    ended_at_ = Clock::now();
    changed_.notify_all();
  }
}

}  // namespace isomesh::http
