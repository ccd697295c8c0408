#include "server/http/kept_uploads.h"

#include <algorithm>
#include <utility>

#include "base/ids.h"
#include "proto/error.h"

namespace isomesh::http {

KeptUploads::KeptUploads(const KeptLimits& limits)
    : limits_(limits), thread_([this](const std::stop_token& stop) { run(stop); }) {}

std::string KeptUploads::keep(const std::string& owner, Kept upload) {
  constexpr std::size_t kNameBytes = 16;
  std::string name = random_hex(kNameBytes);
  const Lock lock(mutex_);
  const auto is_owners = [&owner](const Entry& entry) { return entry.owner == owner; };
  const auto count = static_cast<std::size_t>(std::ranges::count_if(kept_, is_owners));
  if (count >= limits_.each) {
    kept_.erase(std::ranges::find_if(kept_, is_owners));
  } else if (kept_.size() >= limits_.all) {
    kept_.pop_front();
  }
  kept_.push_back({owner, name, std::move(upload), Clock::now() + limits_.time});
  changed_.notify_all();
  return name;
}

KeptUploads::Kept KeptUploads::find(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  const auto found = std::ranges::find_if(
      kept_, [&](const Entry& entry) { return entry.owner == owner && entry.name == name; });
  if (found == kept_.end()) {
    throw Error(ErrorCode::kGone, "this upload is not kept any more; send it again");
  }
  found->until = Clock::now() + limits_.time;
  kept_.splice(kept_.end(), kept_, found);
  return found->upload;
}

void KeptUploads::let_go(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  std::erase_if(kept_,
                [&](const Entry& entry) { return entry.owner == owner && entry.name == name; });
}

void KeptUploads::let_all_go() {
  const Lock lock(mutex_);
  kept_.clear();
}

void KeptUploads::run(const std::stop_token& stop) {
  Lock lock(mutex_);
  while (!stop.stop_requested()) {
    std::erase_if(kept_, [](const Entry& entry) { return entry.until <= Clock::now(); });
    const auto is_there = [this]() ISOMESH_REQUIRES(mutex_) { return !kept_.empty(); };
    if (!changed_.wait(lock, stop, is_there)) return;
    const Clock::time_point next = kept_.front().until;
    changed_.wait_until(lock, stop, next, [] { return false; });
  }
}

}  // namespace isomesh::http
