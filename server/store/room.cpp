#include "server/store/room.h"

#include <algorithm>
#include <utility>

#include "proto/error.h"

namespace isomesh::store {

void Room::limit(std::uint64_t max_bytes, MakeRoom make) {
  max_bytes_ = max_bytes;
  make_ = std::move(make);
}

void Room::take(std::uint64_t bytes, const std::string& owner) {
  // Others may take the space that was freed.
  constexpr int kTries = 3;
  for (int n = 0; n < kTries; ++n) {
    if (try_take(bytes, owner)) return;
    if (bytes > max_bytes_) break;
    make_({.owner = owner, .bytes = bytes, .unfinished = unfinished(owner)});
  }
  if (!try_take(bytes, owner)) {
    throw Error(ErrorCode::kOutOfSpace, "the space for volumes and meshes is used up");
  }
}

void Room::finish(std::uint64_t bytes, const std::string& owner) {
  const Lock lock(mutex_);
  const auto found = unfinished_.find(owner);
  if (found == unfinished_.end()) return;
  found->second -= std::min(found->second, bytes);
  if (found->second == 0) unfinished_.erase(found);
}

bool Room::try_take(std::uint64_t bytes, const std::string& owner) {
  const Lock lock(mutex_);
  const bool fits = max_bytes_ == 0 || (bytes <= max_bytes_ && used_ <= max_bytes_ - bytes);
  if (!fits) return false;
  used_ += bytes;
  unfinished_[owner] += bytes;
  return true;
}

std::uint64_t Room::unfinished(const std::string& owner) const {
  const Lock lock(mutex_);
  const auto found = unfinished_.find(owner);
  return found == unfinished_.end() ? 0 : found->second;
}

void Room::correct(std::uint64_t taken, std::uint64_t bytes) {
  const Lock lock(mutex_);
  used_ += bytes;
  used_ -= std::min(used_, taken);
}

void Room::give(std::uint64_t bytes) {
  const Lock lock(mutex_);
  used_ -= std::min(used_, bytes);
}

void Room::recount(std::uint64_t bytes) {
  const Lock lock(mutex_);
  used_ = bytes;
}

std::uint64_t Room::used() const {
  const Lock lock(mutex_);
  return used_;
}

}  // namespace isomesh::store
