#include "server/store/retention.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/clock.h"
#include "base/log.h"
#include "proto/error.h"

namespace isomesh::store {
namespace {

// Limit for one transaction, so that others do not wait for long.
constexpr std::size_t kMostAtOnce = 100;
// Longer than any upload or job uses a file there.
constexpr std::chrono::hours kLongestScratch{24};
// Longer than a client that follows a job may be absent.
constexpr std::chrono::days kEventsKept{2};

}  // namespace

// Collects what expires in one round by one limit. Logs on destruction, so that removals are logged
// even after an error.
class Retention::Report {
 public:
  explicit Report(std::string_view limit) : limit_(limit) {}
  ~Report() {
    tell("volumes", volumes_);
    tell("jobs", jobs_);
  }
  Report(const Report&) = delete;
  Report& operator=(const Report&) = delete;

  void add(const Expired& expired) {
    for (const Expirable& record : expired.records) {
      (record.kind == RecordKind::kJob ? jobs_ : volumes_).add(record);
    }
  }

 private:
  struct Kind {
    std::size_t count = 0;
    std::string named;  // the first ones

    void add(const Expirable& record) {
      constexpr std::size_t kMostNamed = 10;
      if (++count > kMostNamed) return;
      if (!named.empty()) named += ", ";
      named += record.id + " unused since " + timestamp_of(record.last_used);
    }
  };

  void tell(std::string_view kind, const Kind& gone) const {
    if (gone.count == 0) return;
    LogLine("expired")
        .add("kind", kind)
        .add("count", gone.count)
        .add("limit", limit_)
        .add("first", gone.named);
  }

  const std::string_view limit_;
  Kind volumes_;
  Kind jobs_;
};

Retention::Gone Retention::enforce() {
  const Time now = options_.now();
  // Files are dated by the system's clock, whether it is right or not.
  const Time of_files = std::min(now, std::chrono::system_clock::now());
  Gone gone;
  sweep_scratch(of_files);
  const auto removal = jobs_.claim_removal();
  if (!removal) return gone;
  {
    const Lock lock(mutex_);
    expire_old(now, gone);
    if (options_.max_bytes > 0) shrink_for({}, gone);
    gone.blobs += erase_garbage();
  }
  sweep_blobs(gone);
  gone.blobs += blobs_.empty_quarantine(of_files - options_.quarantine, names());
  forget(now);
  return gone;
}

void Retention::make_room(const Incoming& incoming) {
  if (options_.max_bytes == 0) return;
  const Lock lock(mutex_);
  Gone gone;
  if (incoming.bytes <= options_.max_bytes && shrink_for(incoming, gone)) return;
  throw Error(ErrorCode::kOutOfSpace, "the space for volumes and meshes is used up");
}

std::uint64_t Retention::named_bytes() const {
  return jobs_.named_bytes() + volumes_.named_bytes();
}

Names Retention::names() const {
  return [this](const std::string& key) { return volumes_.names(key); };
}

void Retention::expire_old(Time now, Gone& gone) {
  const Time cutoff = now - options_.keep;
  Report report("--keep-days");
  while (true) {
    const std::vector<Expirable> items = oldest({cutoff}, Ended::kAll);
    expire(items, kAllBytes, gone, report);
    if (items.size() < kMostAtOnce) return;
  }
}

bool Retention::shrink_for(const Incoming& incoming, Gone& gone) {
  const std::uint64_t max_bytes = options_.max_bytes - incoming.bytes;
  Report report("--max-disk");
  while (true) {
    const std::uint64_t used = blobs_.bytes();
    if (used <= max_bytes) return true;
    if (const std::size_t erased =
            erase_garbage() + blobs_.empty_quarantine(Time::max(), names())) {
      gone.blobs += erased;
      continue;
    }
    // Space of expired blobs that cannot be erased yet will become free, so nothing more expires
    // for it.
    const std::uint64_t going = garbage_bytes();
    if (used <= max_bytes + going) return false;
    const Superfluous superfluous = this->superfluous(incoming);
    if (superfluous.items.empty()) return false;
    expire(superfluous.items, std::min(used - max_bytes - going, superfluous.enough), gone, report);
  }
}

std::uint64_t Retention::garbage_bytes() const {
  std::uint64_t bytes = 0;
  for (const std::string& key : garbage_) bytes += blobs_.size(key).value_or(0);
  return bytes;
}

// The oldest data of the owner with most data, so that one owner's many uploads do not displace
// those of others (longest queue drop: Suter, Lakshman, Stiliadis and Choudhury, 1998).
Retention::Superfluous Retention::superfluous(const Incoming& incoming) const {
  OwnedBytes owned = volumes_.owned_bytes();
  for (const auto& [owner, bytes] : jobs_.owned_bytes()) owned[owner] += bytes;
  owned[incoming.owner] += incoming.bytes + incoming.unfinished;
  std::vector<std::pair<std::uint64_t, std::string>> most;
  for (const auto& [owner, bytes] : owned) most.emplace_back(bytes, owner);
  std::ranges::sort(most, std::greater());
  for (std::size_t n = 0; n < most.size(); ++n) {
    const std::uint64_t next = n + 1 < most.size() ? most[n + 1].first : 0;
    // Jobs without a mesh take no space; they expire by age only.
    std::vector<Expirable> items = oldest({Time::max(), most[n].second}, Ended::kWithMesh);
    if (!items.empty()) return {std::move(items), std::max<std::uint64_t>(1, most[n].first - next)};
  }
  return {};
}

std::vector<Expirable> Retention::oldest(const ExpiryFilter& filter, Ended which) const {
  const std::vector<Expirable> jobs = jobs_.ended(filter, which, kMostAtOnce);
  const std::vector<Expirable> volumes = volumes_.unused(filter, kMostAtOnce);
  std::vector<Expirable> items;
  std::ranges::merge(jobs, volumes, std::back_inserter(items), {}, &Expirable::last_used,
                     &Expirable::last_used);
  items.resize(std::min(items.size(), kMostAtOnce));
  return items;
}

void Retention::expire(std::span<const Expirable> items, std::uint64_t enough, Gone& gone,
                       Report& report) {
  std::uint64_t freed = 0;
  while (!items.empty() && freed < enough) {
    const RecordKind kind = items.front().kind;
    const auto other =
        std::ranges::find_if(items, [kind](const Expirable& item) { return item.kind != kind; });
    const auto alike = items.first(static_cast<std::size_t>(other - items.begin()));
    const bool is_job = kind == RecordKind::kJob;
    const Expired expired =
        is_job ? jobs_.expire(alike, enough - freed) : volumes_.expire(alike, enough - freed);
    report.add(expired);
    (is_job ? gone.jobs : gone.volumes) += expired.records.size();
    freed += expired.bytes;
    garbage_.insert(garbage_.end(), expired.blobs.begin(), expired.blobs.end());
    items = items.subspan(alike.size());
  }
}

// Blobs stored since this time may still be named: a worker names its blobs at the end of its run.
Steady Retention::spare_since() const {
  const Steady now = Steady::clock::now();
  return std::min(now, jobs_.oldest_run().value_or(now)) - options_.grace;
}

std::size_t Retention::erase_garbage() {
  const std::size_t before = garbage_.size();
  garbage_ = blobs_.erase_unnamed(garbage_, spare_since(), names());
  return before - garbage_.size();
}

// Without the lock: a sweep lists every file, and callers of make_room() need not wait for it.
void Retention::sweep_blobs(Gone& gone) {
  const Steady now = Steady::clock::now();
  {
    const Lock lock(mutex_);
    if (now < next_sweep_) return;
  }
  const Swept swept = blobs_.sweep(spare_since(), names());
  gone.quarantined = swept.quarantined;
  gone.left = swept.left;
  const Lock lock(mutex_);
  if (swept.left > 0) next_sweep_ = now + options_.sweep_pause;
}

void Retention::sweep_scratch(Time now) {
  std::error_code gone;  // files come and go meanwhile
  const auto cutoff = std::chrono::file_clock::from_sys(now) - kLongestScratch;
  for (const auto& entry : std::filesystem::directory_iterator(scratch_, gone)) {
    const auto written = entry.last_write_time(gone);
    if (!gone && written < cutoff) std::filesystem::remove_all(entry.path(), gone);
  }
}

void Retention::forget(Time now) {
  jobs_.forget_expired(now - options_.remember);
  jobs_.forget_events(now - kEventsKept);
}

}  // namespace isomesh::store
