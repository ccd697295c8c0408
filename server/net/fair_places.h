#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "base/mutex.h"

namespace isomesh::net {

// A number of places. A party may take one while it has a share (has_share), and keeps it until it
// releases it.
//
// A party is identified by its name: an address or an owner; "" is all clients of a proxy. Thread
// safe; must outlive its places.
class FairPlaces {
 public:
  using Counts = std::map<std::string, std::size_t>;

  // Releases its place on destruction, which is thread safe.
  class Place {
   public:
    Place() = default;
    Place(Place&& other) noexcept;
    Place& operator=(Place&& other) noexcept;
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    ~Place();

   private:
    friend FairPlaces;
    Place(FairPlaces* places, Counts::iterator party) : places_(places), party_(party) {}

    FairPlaces* places_ = nullptr;
    Counts::iterator party_;
  };

  // `what` names the places in errors: "uploads".
  FairPlaces(std::size_t count, std::string_view what) : count_(count), what_(what) {}

  // Throws Error kTooManyRequests if the party has its share, and kUnavailable if no place is free.
  Place take(const std::string& party) ISOMESH_EXCLUDES(mutex_);

  std::size_t taken() const ISOMESH_EXCLUDES(mutex_);

 private:
  void give_back(Counts::iterator party) ISOMESH_EXCLUDES(mutex_);

  const std::size_t count_;
  const std::string what_;
  mutable Mutex mutex_;
  std::size_t taken_ ISOMESH_GUARDED_BY(mutex_) = 0;
  Counts parties_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::net
