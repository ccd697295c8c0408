#include "server/http/task_queue.h"

#include <utility>

namespace isomesh::http {

namespace {

constexpr std::chrono::milliseconds kPatience{2};

}  // namespace

std::size_t usual_prompt_threads() { return std::thread::hardware_concurrency() + 2; }

BoundedTaskQueue::BoundedTaskQueue(std::size_t threads, std::size_t capacity, std::size_t prompt)
    : capacity_(capacity), prompt_(prompt) {
  for (std::size_t i = 0; i < threads; ++i) {
    threads_.emplace_back([this] { work(); });
  }
}

BoundedTaskQueue::~BoundedTaskQueue() { shutdown(); }

bool BoundedTaskQueue::try_enqueue(std::function<void()>&& task) {
  bool is_seen_to = false;
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || queue_.size() >= capacity_) return false;
    queue_.push_back({std::move(task), Clock::now() + kPatience});
    is_seen_to = under_way_ >= prompt_ && is_watched_;
  }
  if (!is_seen_to) changed_.notify_one();
  return true;
}

void BoundedTaskQueue::shutdown() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }
  threads_.clear();
}

void BoundedTaskQueue::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    if (queue_.empty()) {
      if (closed_) return;
      changed_.wait(lock);
      continue;
    }
    const Clock::time_point due = queue_.front().due;
    if (under_way_ >= prompt_ && !closed_ && Clock::now() < due) {
      if (is_watched_) {
        changed_.wait(lock);
      } else {
        is_watched_ = true;
        changed_.wait_until(lock, due);
        is_watched_ = false;
      }
      continue;
    }
    Task task = std::move(queue_.front());
    queue_.pop_front();
    ++under_way_;
    if (!queue_.empty() && !is_watched_) changed_.notify_one();
    lock.unlock();
    task.run();
    task = {};  // what it holds may take a while to go
    lock.lock();
    --under_way_;
  }
}

}  // namespace isomesh::http
