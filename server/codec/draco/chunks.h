// Work that one thread produces and any free thread consumes. Private to this folder.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

namespace isomesh::codec::edgebreaker {

// Items 0, 1, 2, ... in order. One thread publishes them; it and a helper process them in chunks.
// Nobody waits for a helper that never starts: the producer processes the remaining items.
class Chunks {
 public:
  // Not while another thread uses it.
  void reset() {
    there_.store(0, std::memory_order_relaxed);
    taken_.store(0, std::memory_order_relaxed);
    helped_.store(false, std::memory_order_relaxed);
  }

  // Calls produce(bring); bring(count) publishes the items below `count`, and processes them unless
  // a helper does. No more items follow when `produce` ends or throws, so a helper ends, too.
  template <class Work, class Produce>
  void produce(Work work, Produce produce) {
    {
      const struct Close {
        ~Close() { chunks.close(); }
        Chunks& chunks;
      } close{*this};
      produce([&](std::uint32_t count) { bring(count, work); });
    }
    while (take(work)) {
    }
  }

  // Processes items until the end. Only call it once the producer runs.
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

  template <class Work>
  void bring(std::uint32_t count, Work& work) {
    there_.store(count, std::memory_order_release);
    if (helped_.load(std::memory_order_relaxed)) {
      there_.notify_one();
    } else {
      while (take(work)) {
      }
    }
  }

  void close() {
    there_.fetch_or(kAll, std::memory_order_release);
    there_.notify_one();
  }

  // Calls work(begin, end) for the next items. Returns false if there are none.
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
