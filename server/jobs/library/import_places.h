#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>
#include <stop_token>
#include <string>
#include <utility>

#include "base/mutex.h"

namespace isomesh::jobs {

// Places for imports, which parties take in turns: a free place goes to the waiting party with the
// fewest imports, and among several to the one whose last import ended first. So a party with many
// uploads uses all places while nobody else waits, and delays another by one import.
//
// A party is identified by its name: an address or an owner. Thread safe; must outlive its places.
class ImportPlaces {
 public:
  class Place {
   public:
    Place(ImportPlaces& places, std::string party) : places_(places), party_(std::move(party)) {}
    ~Place() { places_.give_back(party_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

   private:
    ImportPlaces& places_;
    const std::string party_;
  };

  explicit ImportPlaces(std::size_t count) : free_(count) {}

  // Waits for a place. Throws Error kUnavailable when stopped.
  Place take(const std::string& party, const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);

  // The number of imports that wait for a place.
  std::size_t waiting() const ISOMESH_EXCLUDES(mutex_);

 private:
  struct Line {
    std::string party;
    std::deque<std::uint64_t> waiting = {};  // tickets, oldest first
    std::size_t running = 0;
  };
  // The parties with imports, waiting or running; the one whose last import ended first is first.
  using Lines = std::list<Line>;

  void give_back(const std::string& party) ISOMESH_EXCLUDES(mutex_);
  Lines::iterator line_of(const std::string& party) ISOMESH_REQUIRES(mutex_);
  bool is_turn_of(const Line& line, std::uint64_t ticket) const ISOMESH_REQUIRES(mutex_);
  void forget_if_idle(Lines::iterator line) ISOMESH_REQUIRES(mutex_);

  mutable Mutex mutex_;
  Condition changed_;
  Lines lines_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t free_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t tickets_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::jobs
