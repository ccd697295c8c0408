// Work that one thread brings and whoever is free does; private to this folder.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

namespace isomesh::codec::edgebreaker {

// Items 0, 1, 2, ... in order, which one thread says are there and which are taken in chunks by it
// and by another. Nobody waits for a thread that has not come: the one that brings them takes what
// nobody took.
class Chunks {
 public:
  // While nobody uses it.
  void reset() {
    there_.store(0, std::memory_order_relaxed);
    taken_.store(0, std::memory_order_relaxed);
    helped_.store(false, std::memory_order_relaxed);
  }

  // The items below `count` are there. Does them, unless somebody helps.
  template <class Work>
  void bring(std::uint32_t count, Work work) {
    there_.store(count, std::memory_order_release);
    if (helped_.load(std::memory_order_relaxed)) {
      there_.notify_one();
    } else {
      while (take(work)) {
      }
    }
  }

  // No more items come. Does those that are left.
  template <class Work>
  void end(Work work) {
    there_.fetch_or(kAll, std::memory_order_release);
    there_.notify_one();
    while (take(work)) {
    }
  }

  // Does what comes until the end; only for a thread that knows that the one which brings is at it.
  template <class Work>
  void help(Work work) {
    helped_.store(true, std::memory_order_relaxed);
    for (;;) {
      const std::uint32_t there = there_.load(std::memory_order_acquire);
      if (take(work)) continue;
      if ((there & kAll) != 0) return;
      there_.wait(there, std::memory_order_acquire);
    }
  }

 private:
  static constexpr std::uint32_t kAll = 1U << 31;
  static constexpr std::uint32_t kMostAtOnce = 1024;

  // work(begin, end) for the next items. False when there are none.
  template <class Work>
  bool take(Work& work) {
    std::uint32_t begin = taken_.load(std::memory_order_relaxed);
    for (;;) {
      const std::uint32_t there = there_.load(std::memory_order_acquire) & ~kAll;
      if (begin == there) return false;
      const std::uint32_t end = begin + std::min(there - begin, kMostAtOnce);
      if (taken_.compare_exchange_weak(begin, end, std::memory_order_relaxed)) {
        work(begin, end);
        return true;
      }
    }
  }

  std::atomic<std::uint32_t> there_ = 0;
  std::atomic<std::uint32_t> taken_ = 0;
  std::atomic<bool> helped_ = false;
};

}  // namespace isomesh::codec::edgebreaker
