#include "server/net/parked.h"

#include <algorithm>
#include <utility>

namespace isomesh::net {

Parked::Parked(HasEnded has_ended)
    : has_ended_(std::move(has_ended)),
      clock_([this](const std::stop_token& stop) { resume_overdue(stop); }) {}

Parked::~Parked() {
  close();
  clock_.request_stop();
}

void Parked::park(ParkedRequest request) {
  const std::string job = request.job;
  {
    Lock lock(mutex_);
    if (closed_ || requests_.size() >= kMostRequests) {
      lock.unlock();
      return request.resume();
    }
    requests_.push_back(std::move(request));
    ++count_;
    changed_.notify_all();
  }
  // The job may have ended after its handler looked and before the request was here to be told.
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
    const auto first =
        std::stable_partition(requests_.begin(), requests_.end(),
                              [&](const ParkedRequest& request) { return !is_over(request); });
    over.assign(std::make_move_iterator(first), std::make_move_iterator(requests_.end()));
    requests_.erase(first, requests_.end());
  }
  for (const ParkedRequest& request : over) request.resume();
}

void Parked::resume_overdue(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    {
      Lock lock(mutex_);
      Clock::time_point next = Clock::time_point::max();
      for (const ParkedRequest& request : requests_) next = std::min(next, request.until);
      if (next == Clock::time_point::max()) {
        changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) { return !requests_.empty(); });
        continue;
      }
      const std::uint64_t count = count_;
      changed_.wait_until(lock, stop, next,
                          [this, count]() ISOMESH_REQUIRES(mutex_) { return count_ != count; });
    }
    const auto now = Clock::now();
    resume_if([&](const ParkedRequest& request) { return now >= request.until; });
  }
}

}  // namespace isomesh::net
