#include "server/store/believed_clock.h"

#include <algorithm>
#include <utility>

#include "base/log.h"

namespace isomesh::store {

BelievedClock::BelievedClock(Time last_seen, Options options)
    : options_(std::move(options)), believed_(last_seen), since_(options_.steady()) {}

Time BelievedClock::now() {
  const Lock lock(mutex_);
  const Time wall = options_.wall();
  const Steady steady = options_.steady();
  const Time expected = believed_ + std::chrono::duration_cast<Time::duration>(steady - since_);
  const Doubt before = doubt_;
  doubt_ = wall > expected + options_.tolerance   ? Doubt::kAhead
           : wall < expected - options_.tolerance ? Doubt::kBehind
                                                  : Doubt::kNone;
  believed_ = doubt_ == Doubt::kAhead ? expected : std::max(expected, wall);
  since_ = steady;
  if (doubt_ != before) tell_doubt();
  return believed_;
}

void BelievedClock::tell_doubt() const {
  if (doubt_ == Doubt::kAhead) {
    log_warning(
        "{} is far ahead of the newest record: until it is right, nothing expires by it. If the "
        "service was off for that long, start once with --trust-clock",
        options_.name);
  } else if (doubt_ == Doubt::kBehind) {
    log_warning(
        "{} is far behind the newest record: until it is right, what is kept ages only while the "
        "service runs",
        options_.name);
  }
}

BelievedClock::Doubt BelievedClock::doubt() const {
  const Lock lock(mutex_);
  return doubt_;
}

}  // namespace isomesh::store
