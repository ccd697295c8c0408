#include "server/http/requests/kept_uploads.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kNameBytes = 16;

Error gone() { return {ErrorCode::kGone, "this upload is no longer kept: send it again"}; }

}  // namespace

KeptUploads::KeptUploads(const KeptLimits& limits, std::filesystem::path folder,
                         std::function<Clock::time_point()> now)
    : limits_(limits),
      folder_(std::move(folder)),
      now_(std::move(now)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {
  if (!folder_.empty()) find_left();
}

void KeptUploads::find_left() {
  namespace fs = std::filesystem;
  std::error_code absent;
  std::vector<Partial> left;
  std::set<fs::path> unknown;
  for (const auto& entry : fs::directory_iterator(folder_, absent)) {
    unknown.insert(entry.path());
  }
  const std::set<fs::path> files = unknown;
  for (const fs::path& file : files) {
    if (file.extension() != ".json") continue;
    try {
      left.push_back(std::make_shared<PartialUpload>(folder_, file.stem().string()));
      unknown.erase(file);
      unknown.erase(folder_ / file.stem());
    } catch (const Error& error) {
      log_info("an incomplete upload is discarded: {}", error.what());
    }
  }
  for (const fs::path& file : unknown) fs::remove(file, absent);
  std::ranges::sort(left, {}, [](const Partial& each) { return each->written_at(); });
  const Lock lock(mutex_);
  for (Partial& each : left) {
    const auto age = fs::file_time_type::clock::now() - each->written_at();
    Entry entry{each->note().owner, each->name(), nullptr, std::move(each), {}};
    entry.until = end_of(entry) - std::chrono::duration_cast<Clock::duration>(age);
    kept_.push_back(std::move(entry));
  }
  make_room();
  changed_.notify_all();
}

KeptUploads::Clock::time_point KeptUploads::end_of(const Entry& entry) const {
  const bool comes = entry.partial && !entry.partial->note().is_complete;
  return now_() + (comes ? limits_.part_time : limits_.time);
}

std::string KeptUploads::keep(const std::string& owner, Kept upload) {
  std::string name = random_hex(kNameBytes);
  const Lock lock(mutex_);
  const auto is_whole = [](const Entry& entry) { return !entry.partial; };
  const auto is_owners = [&](const Entry& entry) {
    return is_whole(entry) && entry.owner == owner;
  };
  if (std::cmp_greater_equal(std::ranges::count_if(kept_, is_owners), limits_.each)) {
    kept_.erase(std::ranges::find_if(kept_, is_owners));
  } else if (std::cmp_greater_equal(std::ranges::count_if(kept_, is_whole), limits_.all)) {
    kept_.erase(std::ranges::find_if(kept_, is_whole));
  }
  kept_.push_back({owner, name, std::move(upload), nullptr, now_() + limits_.time});
  changed_.notify_all();
  return name;
}

KeptUploads::Partial KeptUploads::begin(PartialNote note) {
  std::filesystem::create_directories(folder_);
  const std::string owner = note.owner;
  auto upload = std::make_shared<PartialUpload>(folder_, random_hex(kNameBytes), std::move(note));
  const Lock lock(mutex_);
  kept_.push_back({owner, upload->name(), nullptr, upload, now_() + limits_.part_time});
  make_room();
  changed_.notify_all();
  return upload;
}

KeptUploads::Kept KeptUploads::find(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  const auto entry = found(owner, name);
  if (!entry->partial) return entry->upload;
  if (!entry->partial->note().is_complete) {
    throw Error(ErrorCode::kNotReady, "this upload is not complete yet");
  }
  Kept body = entry->partial->body();
  if (!body) throw gone();
  return body;
}

KeptUploads::Partial KeptUploads::find_partial(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  const auto entry = found(owner, name);
  if (!entry->partial) throw gone();
  return entry->partial;
}

KeptUploads::Partial KeptUploads::partial_of(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  return found(owner, name)->partial;
}

KeptUploads::Entries::iterator KeptUploads::look_up(const std::string& owner,
                                                    const std::string& name) {
  return std::ranges::find_if(
      kept_, [&](const Entry& each) { return each.owner == owner && each.name == name; });
}

KeptUploads::Entries::iterator KeptUploads::found(const std::string& owner,
                                                  const std::string& name) {
  const auto entry = look_up(owner, name);
  if (std::ranges::count(cancelled_, std::pair(owner, name)) > 0) {
    throw Error(ErrorCode::kCancelled, "the upload was cancelled");
  }
  if (entry == kept_.end()) throw gone();
  entry->until = end_of(*entry);
  kept_.splice(kept_.end(), kept_, entry);
  return entry;
}

void KeptUploads::finish(const std::string& owner, const std::string& name,
                         const std::string& volume, const Parameters& read_with) {
  const Lock lock(mutex_);
  const auto entry = look_up(owner, name);
  if (entry == kept_.end()) return;
  if (!entry->partial) return erase(entry);
  entry->partial->become(volume, read_with);
}

void KeptUploads::let_go(const std::string& owner, const std::string& name) {
  const Lock lock(mutex_);
  const auto entry = look_up(owner, name);
  if (entry != kept_.end()) erase(entry);
}

std::vector<std::string> KeptUploads::cancel(const std::string& owner, const std::string& name) {
  Lock lock(mutex_);
  const auto entry = look_up(owner, name);
  const Partial partial = entry == kept_.end() ? nullptr : entry->partial;
  if (!partial) throw gone();
  erase(entry);
  cancelled_.emplace_back(owner, name);
  if (cancelled_.size() > limits::kMostCancelledUploads) cancelled_.pop_front();
  lock.unlock();
  std::vector<std::string> stored = partial->cancel();
  const std::string volume = partial->note().volume;
  // An earlier process may have stored it.
  if (stored.empty() && !volume.empty()) stored.push_back(volume_from_json(volume).id);
  return stored;
}

void KeptUploads::let_all_go() {
  const Lock lock(mutex_);
  for (auto entry = kept_.begin(); entry != kept_.end();) {
    const auto next = std::next(entry);
    if (entry->may_go()) erase(entry);
    entry = next;
  }
}

std::uint64_t KeptUploads::idle_bytes() {
  const auto size_of = [](const Entry& entry) {
    std::error_code absent;
    if (entry.partial) return entry.partial->bytes();
    const std::uintmax_t size =
        entry.upload ? std::filesystem::file_size(entry.upload->path, absent) : 0;
    return absent ? 0 : std::uint64_t{size};
  };
  const Lock lock(mutex_);
  std::uint64_t sum = 0;
  for (const Entry& entry : kept_) sum += entry.may_go() ? size_of(entry) : 0;
  return sum;
}

void KeptUploads::wake() {
  const Lock lock(mutex_);
  is_woken_ = true;
  changed_.notify_all();
}

void KeptUploads::erase(Entries::iterator entry) {
  if (entry->partial) entry->partial->let_go();
  kept_.erase(entry);
}

void KeptUploads::make_room() {
  const auto has_become = [](const Entry& entry) { return !entry.partial->note().volume.empty(); };
  const auto unfinished = [&](const Entry& entry) { return has_become(entry) ? 0U : 1U; };
  const auto finished = [&](const Entry& entry) { return has_become(entry) ? 1U : 0U; };
  const auto bytes = [](const Entry& entry) { return entry.partial->bytes(); };
  const auto make = [&](const std::function<std::uint64_t(const Entry&)>& weight,
                        std::uint64_t most) ISOMESH_REQUIRES(mutex_) {
    while (true) {
      std::uint64_t all = 0;
      for (const Entry& entry : kept_) all += entry.partial ? weight(entry) : 0;
      const auto next = all > most ? next_to_go(weight) : kept_.end();
      if (next == kept_.end()) return;
      erase(next);
    }
  };
  make(unfinished, limits_.parts);
  make(finished, limits_.parts);
  make(bytes, limits_.part_bytes);
}

KeptUploads::Entries::iterator KeptUploads::next_to_go(
    const std::function<std::uint64_t(const Entry&)>& weight) {
  std::map<std::string, std::uint64_t> of_owner;
  for (const Entry& entry : kept_) {
    if (entry.is_idle()) of_owner[entry.owner] += weight(entry);
  }
  const auto most =
      std::ranges::max_element(of_owner, {}, [](const auto& owner) { return owner.second; });
  if (most == of_owner.end() || most->second == 0) return kept_.end();
  return std::ranges::find_if(kept_, [&](const Entry& entry) {
    return entry.is_idle() && entry.owner == most->first && weight(entry) > 0;
  });
}

void KeptUploads::run(const std::stop_token& stop) {
  Lock lock(mutex_);
  while (!stop.stop_requested()) {
    const Clock::time_point now = now_();
    // Later entries expire after that.
    Clock::time_point next = now + std::min(limits_.time, limits_.part_time);
    for (auto entry = kept_.begin(); entry != kept_.end();) {
      const auto after = std::next(entry);
      // Skip uploads that a client is sending.
      if (entry->partial && !entry->is_idle())
        entry->until = std::max(entry->until, end_of(*entry));
      if (entry->until <= now) {
        erase(entry);
      } else {
        next = std::min(next, entry->until);
      }
      entry = after;
    }
    make_room();
    const auto is_there = [this]() ISOMESH_REQUIRES(mutex_) { return !kept_.empty(); };
    if (!changed_.wait(lock, stop, is_there)) return;
    changed_.wait_for(lock, stop, next - now, [this]() ISOMESH_REQUIRES(mutex_) {
      return std::exchange(is_woken_, false);
    });
  }
}

}  // namespace isomesh::http
