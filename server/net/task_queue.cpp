#include "server/net/task_queue.h"

#include <algorithm>
#include <utility>

#include "base/niceness.h"
#include "base/share.h"

namespace isomesh::net {

BoundedTaskQueue::BoundedTaskQueue(std::size_t threads, std::size_t capacity, int niceness)
    : capacity_(capacity), idle_(threads) {
  try {
    for (std::size_t i = 0; i < threads; ++i) {
      threads_.emplace_back([this, niceness] {
        be_nicer(niceness);
        work();
      });
    }
  } catch (...) {
    shutdown();  // otherwise started threads would wait for tasks for ever
    throw;
  }
}

BoundedTaskQueue::~BoundedTaskQueue() { shutdown(); }

bool BoundedTaskQueue::try_enqueue(const std::string& party, Task&& task) {
  {
    const Lock lock(mutex_);
    if (closed_ || waiting_ >= capacity_) return false;
    const auto line = line_of(party);
    if (!has_share(party, line->tasks.size(), capacity_ - waiting_)) return false;
    add(line, std::move(task));
  }
  changed_.notify_one();
  return true;
}

bool BoundedTaskQueue::enqueue_rest(const std::string& party, Task&& task) {
  {
    const Lock lock(mutex_);
    if (closed_) return false;
    add(line_of(party), std::move(task));
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
  Lock lock(mutex_);
  while (true) {
    auto line = lines_.end();
    changed_.wait(lock, [&]() ISOMESH_REQUIRES(mutex_) {
      line = next();
      return line != lines_.end() || (closed_ && waiting_ == 0);
    });
    if (line == lines_.end()) return;
    Task task = std::move(line->tasks.front());
    line->tasks.pop_front();
    --waiting_;
    --idle_;
    ++line->running;
    lines_.splice(lines_.end(), lines_, line);
    if (waiting_ > 0) changed_.notify_one();  // several parties may have become eligible
    lock.unlock();
    task();
    task = nullptr;  // destroyed without the lock
    lock.lock();
    --line->running;
    ++idle_;
    if (line->tasks.empty() && line->running == 0) lines_.erase(line);
    if (closed_) changed_.notify_all();
  }
}

BoundedTaskQueue::Lines::iterator BoundedTaskQueue::line_of(const std::string& party) {
  const auto line = std::ranges::find(lines_, party, &Line::party);
  return line != lines_.end()
             ? line
             : lines_.insert(lines_.end(), Line{.party = party, .tasks = {}, .running = 0});
}

void BoundedTaskQueue::add(Lines::iterator line, Task&& task) {
  line->tasks.push_back(std::move(task));
  ++waiting_;
}

// The next party; end() if no party with a share of the threads has a task.
BoundedTaskQueue::Lines::iterator BoundedTaskQueue::next() {
  return std::ranges::find_if(lines_, [this](const Line& line) ISOMESH_REQUIRES(mutex_) {
    return !line.tasks.empty() && has_share(line.party, line.running, idle_);
  });
}

}  // namespace isomesh::net
