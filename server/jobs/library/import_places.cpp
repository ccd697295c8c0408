#include "server/jobs/library/import_places.h"

#include <algorithm>
#include <utility>

#include "proto/error.h"

namespace isomesh::jobs {

ImportPlaces::Place ImportPlaces::take(const std::string& party, const std::stop_token& stop) {
  std::string name = party;  // copied before a place is taken, which would be lost with a failure
  Lock lock(mutex_);
  const auto line = line_of(party);
  const std::uint64_t ticket = tickets_++;
  line->waiting.push_back(ticket);
  const bool is_mine = changed_.wait(lock, stop, [&]() ISOMESH_REQUIRES(mutex_) {
    return free_ > 0 && is_turn_of(*line, ticket);
  });
  std::erase(line->waiting, ticket);
  if (!is_mine || stop.stop_requested()) {
    forget_if_idle(line);
    changed_.notify_all();  // a free place may have waited for this one
    throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  }
  --free_;
  ++line->running;
  changed_.notify_all();  // there may be a place for the next one, too
  return Place(*this, std::move(name));
}

void ImportPlaces::give_back(const std::string& party) {
  const Lock lock(mutex_);
  const auto line = line_of(party);
  ++free_;
  --line->running;
  lines_.splice(lines_.end(), lines_, line);
  forget_if_idle(line);
  changed_.notify_all();
}

std::size_t ImportPlaces::waiting() const {
  const Lock lock(mutex_);
  std::size_t count = 0;
  for (const Line& line : lines_) count += line.waiting.size();
  return count;
}

ImportPlaces::Lines::iterator ImportPlaces::line_of(const std::string& party) {
  const auto line = std::ranges::find(lines_, party, &Line::party);
  return line != lines_.end() ? line : lines_.insert(lines_.end(), Line{.party = party});
}

bool ImportPlaces::is_turn_of(const Line& line, std::uint64_t ticket) const {
  if (line.waiting.front() != ticket) return false;
  const Line* next = nullptr;
  for (const Line& other : lines_) {
    if (other.waiting.empty()) continue;
    if (next == nullptr || other.running < next->running) next = &other;
  }
  return next == &line;
}

void ImportPlaces::forget_if_idle(Lines::iterator line) {
  if (line->waiting.empty() && line->running == 0) lines_.erase(line);
}

}  // namespace isomesh::jobs
