#include "server/net/task_queue.h"

#include <utility>

namespace isomesh::net {

BoundedTaskQueue::BoundedTaskQueue(std::size_t threads, std::size_t capacity)
    : capacity_(capacity) {
  for (std::size_t i = 0; i < threads; ++i) {
    threads_.emplace_back([this] { work(); });
  }
}

BoundedTaskQueue::~BoundedTaskQueue() { shutdown(); }

bool BoundedTaskQueue::try_enqueue(std::function<void()>&& task) {
  {
    const Lock lock(mutex_);
    if (closed_ || queue_.size() >= capacity_) return false;
    queue_.push_back(std::move(task));
  }
  changed_.notify_one();
  return true;
}

void BoundedTaskQueue::shutdown() {
  {
    const Lock lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }
  threads_.clear();
}

void BoundedTaskQueue::work() {
  while (true) {
    std::function<void()> task;
    {
      Lock lock(mutex_);
      changed_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return !queue_.empty() || closed_; });
      if (queue_.empty()) return;
      task = std::move(queue_.front());
      queue_.pop_front();
    }
    task();
  }
}

}  // namespace isomesh::net
