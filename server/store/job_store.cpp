#include "server/store/job_store.h"

#include <algorithm>

#include "server/store/files.h"

namespace isomesh::store {
namespace {

std::size_t queue_of(const Job& job) { return static_cast<std::size_t>(job.parameters.priority); }

double milliseconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

}  // namespace

Job JobStore::submit(const JobParameters& parameters) {
  const std::lock_guard lock(mutex_);
  if (refusing_) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  std::size_t queued = 0;
  for (const auto& queue : queues_) queued += queue.size();
  if (queued >= limits_.max_queued) {
    throw Error(ErrorCode::kUnavailable,
                "the queue is full: " + std::to_string(queued) + " jobs are waiting");
  }
  const std::string id = time_ordered_id();
  Entry& entry = jobs_[id];
  entry.job.id = id;
  entry.job.parameters = parameters;
  entry.job.created = timestamp();
  queues_[queue_of(entry.job)].push_back(id);
  changed_.notify_all();
  return entry.job;
}

std::optional<Lease> JobStore::claim(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  const auto waiting = [&] {
    return std::ranges::find_if(queues_, [](const auto& queue) { return !queue.empty(); });
  };
  changed_.wait(lock, stop, [&] { return waiting() != queues_.end(); });
  if (stop.stop_requested()) return std::nullopt;
  auto& queue = *waiting();
  Entry& entry = jobs_.at(queue.front());
  queue.pop_front();
  entry.fence = ++last_fence_;
  running_.insert(entry.fence);
  entry.stop = std::stop_source();
  entry.job.state = JobState::kRunning;
  entry.job.stage = Stage::kLoad;
  entry.job.started = timestamp();
  entry.job.timing.queue = milliseconds_since(entry.accepted);
  return Lease{entry.job.id, entry.fence, entry.job.parameters, entry.stop.get_token()};
}

bool JobStore::report(const Lease& lease, Stage stage, double progress, const Timing& timing) {
  const std::lock_guard lock(mutex_);
  Entry* entry = leased(lease);
  if (entry == nullptr) return false;
  entry->job.stage = stage;
  entry->job.progress = progress;
  const double queue = entry->job.timing.queue;
  entry->job.timing = timing;
  entry->job.timing.queue = queue;
  return true;
}

bool JobStore::finish(const Lease& lease, const Outcome& outcome, const Timing& timing) {
  const std::lock_guard lock(mutex_);
  Entry* entry = leased(lease);
  if (entry == nullptr) return false;
  Job& job = entry->job;
  const double queue = job.timing.queue;
  job.timing = timing;
  job.timing.queue = queue;
  if (outcome.mesh) {
    for (const auto& [format, file] : outcome.mesh->files) ++mesh_users_[file.sha256];
  }
  if (entry->stop.stop_requested() || (!outcome.mesh && !outcome.error)) {
    if (outcome.mesh) release(*outcome.mesh);
    end(*entry, JobState::kCancelled);
  } else if (outcome.error) {
    job.error = outcome.error;
    end(*entry, JobState::kFailed);
  } else {
    job.mesh = outcome.mesh;
    job.stage = Stage::kDone;
    job.progress = 1;
    end(*entry, JobState::kSucceeded);
  }
  forget_oldest();
  return true;
}

void JobStore::put_back(const Lease& lease) {
  const std::lock_guard lock(mutex_);
  Entry* entry = leased(lease);
  if (entry == nullptr) return;
  Job& job = entry->job;
  if (entry->stop.stop_requested()) {
    end(*entry, JobState::kCancelled);
    return forget_oldest();
  }
  running_.erase(entry->fence);
  job.state = JobState::kQueued;
  job.stage = Stage::kQueue;
  job.progress = 0;
  job.started.reset();
  job.timing = {};
  queues_[queue_of(job)].push_front(job.id);
  changed_.notify_all();
}

Job JobStore::cancel(const std::string& id) {
  const std::lock_guard lock(mutex_);
  Entry& entry = entry_of(id);
  if (entry.job.state == JobState::kQueued) {
    std::erase(queues_[queue_of(entry.job)], id);
    end(entry, JobState::kCancelled);
  } else if (entry.job.state == JobState::kRunning) {
    entry.stop.request_stop();
  }
  Job job = entry.job;
  forget_oldest();
  return job;
}

Job JobStore::get(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return entry_of(id).job;
}

Job JobStore::wait(const std::string& id, std::chrono::milliseconds wait) const {
  std::unique_lock lock(mutex_);
  Job job = entry_of(id).job;
  changed_.wait_for(lock, wait, [&] {
    const auto found = jobs_.find(id);
    // Finished and forgotten while we waited: the last state that was seen is all there is.
    if (found == jobs_.end()) return true;
    job = found->second.job;
    return is_final(job.state) || closed_;
  });
  return job;
}

std::vector<Job> JobStore::list(std::optional<JobState> state, const std::string& after,
                                std::size_t limit) const {
  const std::lock_guard lock(mutex_);
  std::vector<Job> result;
  auto entry = after.empty() ? jobs_.end() : jobs_.lower_bound(after);
  while (entry != jobs_.begin() && result.size() < limit) {
    const Job& job = (--entry)->second.job;
    if (!state || job.state == *state) result.push_back(job);
  }
  return result;
}

std::size_t JobStore::count(JobState state) const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(
      std::ranges::count(jobs_, state, [](const auto& named) { return named.second.job.state; }));
}

bool JobStore::needs_volume(const std::string& volume) const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(jobs_, [&](const auto& named) {
    const Job& job = named.second.job;
    return !is_final(job.state) && job.parameters.volume == volume;
  });
}

bool JobStore::is_full() const {
  const std::lock_guard lock(mutex_);
  std::size_t queued = 0;
  for (const auto& queue : queues_) queued += queue.size();
  return refusing_ || queued >= limits_.max_queued;
}

void JobStore::refuse_new() {
  const std::lock_guard lock(mutex_);
  refusing_ = true;
}

void JobStore::close() {
  const std::lock_guard lock(mutex_);
  refusing_ = true;
  closed_ = true;
  changed_.notify_all();
}

JobStore::Entry& JobStore::entry_of(const std::string& id) {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) throw Error(ErrorCode::kNotFound, "there is no job with this id");
  return found->second;
}

const JobStore::Entry& JobStore::entry_of(const std::string& id) const {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) throw Error(ErrorCode::kNotFound, "there is no job with this id");
  return found->second;
}

JobStore::Entry* JobStore::leased(const Lease& lease) {
  const auto found = jobs_.find(lease.id);
  const bool valid = found != jobs_.end() && found->second.job.state == JobState::kRunning &&
                     found->second.fence == lease.fence;
  return valid ? &found->second : nullptr;
}

void JobStore::end(Entry& entry, JobState state) {
  running_.erase(entry.fence);
  entry.job.state = state;
  entry.job.finished = timestamp();
  entry.job.timing.total = milliseconds_since(entry.accepted);
  finished_.push_back(entry.job.id);
  changed_.notify_all();
}

void JobStore::forget_oldest() {
  while (finished_.size() > limits_.max_finished) {
    const auto oldest = jobs_.find(finished_.front());
    finished_.pop_front();
    if (oldest->second.job.mesh) release(*oldest->second.job.mesh);
    jobs_.erase(oldest);
  }
  erase_unnamed();
}

void JobStore::release(const MeshSummary& mesh) {
  for (const auto& [format, file] : mesh.files) {
    if (--mesh_users_[file.sha256] > 0) continue;
    mesh_users_.erase(file.sha256);
    unnamed_[file.sha256] = last_fence_;
  }
}

void JobStore::erase_unnamed() {
  std::erase_if(unnamed_, [&](const auto& unnamed) {
    const auto& [key, fence] = unnamed;
    if (mesh_users_.contains(key)) return true;  // named again
    if (!running_.empty() && *running_.begin() <= fence) return false;
    blobs_.erase(key);
    return true;
  });
}

}  // namespace isomesh::store
