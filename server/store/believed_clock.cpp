#include "server/store/believed_clock.h"

#include <utility>

namespace isomesh::store {

BelievedClock::BelievedClock(Time last_seen, Options options)
    : options_(std::move(options)), believed_(last_seen), since_(options_.steady()) {}

Time BelievedClock::now() {
  const Lock lock(mutex_);
  const Time wall = options_.wall();
  const Steady steady = options_.steady();
  const Time expected = believed_ + std::chrono::duration_cast<Time::duration>(steady - since_);
  is_doubted_ = wall > expected + options_.tolerance;
  believed_ = is_doubted_ ? expected : wall;
  since_ = steady;
  return believed_;
}

bool BelievedClock::is_doubted() const {
  const Lock lock(mutex_);
  return is_doubted_;
}

}  // namespace isomesh::store
