#include "server/net/parked.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <sys/epoll.h>
#include <unistd.h>

namespace isomesh::net {
namespace {

constexpr int kMostEvents = 64;
constexpr std::uint64_t kWakeup = 0;  // epoll's id; requests have higher ids

}  // namespace

Parked::Parked(HasEnded has_ended) : has_ended_(std::move(has_ended)), epoll_(new_epoll()) {
  watch_or_throw(epoll_.number(), wakeup_.descriptor(), EPOLLIN, kWakeup);
  thread_ = std::jthread([this] { work(); });
}

Parked::~Parked() {
  close();
  stopping_ = true;
  wakeup_.ring();
  thread_.join();
}

void Parked::park(ParkedRequest request) {
  const std::string job = request.job;
  {
    Lock lock(mutex_);
    if (closed_) {
      lock.unlock();
      return request.resume();
    }
    const std::uint64_t id = ++last_id_;
    // An unsupported descriptor is not watched.
    const bool is_watched =
        request.descriptor >= 0 && watch(epoll_.number(), request.descriptor, EPOLLRDHUP, id);
    if (!is_watched) request.descriptor = -1;
    requests_.emplace(id, std::move(request));
  }
  wakeup_.ring();
  // The job may have ended after its handler checked it and before the request was parked.
  if (has_ended_(job)) job_ended(job);
}

void Parked::job_ended(const std::string& job) {
  resume_if([&](const ParkedRequest& request) { return request.job == job; });
}

void Parked::close() {
  {
    const Lock lock(mutex_);
    closed_ = true;
  }
  resume_if([](const ParkedRequest&) { return true; });
}

template <class Predicate>
void Parked::resume_if(const Predicate& is_over) {
  std::vector<ParkedRequest> over;
  {
    const Lock lock(mutex_);
    for (auto named = requests_.begin(); named != requests_.end();) {
      const auto each = named++;
      if (!is_over(std::as_const(each->second))) continue;
      unwatch(each->second);
      over.push_back(std::move(each->second));
      requests_.erase(each);
    }
  }
  for (const ParkedRequest& request : over) request.resume();
}

// Call before the descriptor is used elsewhere or closed.
void Parked::unwatch(ParkedRequest& request) {
  const int descriptor = std::exchange(request.descriptor, -1);
  if (descriptor >= 0) ::epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, descriptor, nullptr);
}

void Parked::work() {
  std::array<epoll_event, kMostEvents> events = {};
  while (!stopping_) {
    const int count =
        ::epoll_wait(epoll_.number(), events.data(), kMostEvents, milliseconds_to_next());
    for (int i = 0; i < count; ++i) {
      const std::uint64_t who = events.at(static_cast<std::size_t>(i)).data.u64;
      if (who == kWakeup) {
        wakeup_.clear();
      } else {
        notice_end(who);
      }
    }
    const auto now = Clock::now();
    resume_if([&](const ParkedRequest& request) { return now >= request.until; });
  }
}

// -1, no timeout, if no request waits.
int Parked::milliseconds_to_next() {
  const Lock lock(mutex_);
  if (requests_.empty()) return -1;
  Clock::time_point next = Clock::time_point::max();
  for (const auto& [id, request] : requests_) next = std::min(next, request.until);
  constexpr std::chrono::milliseconds kLongest{60'000};
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now());
  return static_cast<int>(std::clamp<std::chrono::milliseconds>(wait, {}, kLongest).count());
}

void Parked::notice_end(std::uint64_t id) {
  std::function<void()> abandoned;
  ParkedRequest over;
  {
    const Lock lock(mutex_);
    const auto found = requests_.find(id);
    if (found == requests_.end()) return;  // just resumed
    unwatch(found->second);
    abandoned = std::exchange(found->second.abandoned, nullptr);
    if (!abandoned) {
      over = std::move(found->second);
      requests_.erase(found);
    }
  }
  abandoned ? abandoned() : over.resume();
}

}  // namespace isomesh::net
