#include "server/net/fair_places.h"

#include <utility>

#include "base/share.h"
#include "proto/error.h"

namespace isomesh::net {

FairPlaces::Place::Place(Place&& other) noexcept
    : places_(std::exchange(other.places_, nullptr)), party_(other.party_) {}

FairPlaces::Place& FairPlaces::Place::operator=(Place&& other) noexcept {
  std::swap(places_, other.places_);
  std::swap(party_, other.party_);
  return *this;
}

FairPlaces::Place::~Place() {
  if (places_ != nullptr) places_->give_back(party_);
}

FairPlaces::Place FairPlaces::take(const std::string& party) {
  const Lock lock(mutex_);
  const std::size_t free = count_ - taken_;
  if (free == 0) throw Error(ErrorCode::kUnavailable, "too many " + what_ + " are in progress");
  const auto holder = parties_.try_emplace(party, 0).first;
  if (!has_share(party, holder->second, free)) {
    throw Error(ErrorCode::kTooManyRequests, "you have too many " + what_ + " in progress");
  }
  ++holder->second;
  ++taken_;
  return {this, holder};
}

std::size_t FairPlaces::taken() const {
  const Lock lock(mutex_);
  return taken_;
}

void FairPlaces::give_back(Counts::iterator party) {
  const Lock lock(mutex_);
  --taken_;
  if (--party->second == 0) parties_.erase(party);
}

}  // namespace isomesh::net
