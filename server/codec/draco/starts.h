// Starts of the value order, passed from the traversal to the thread that orders values. Private to
// this folder.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "server/codec/draco/corners.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// A corner from which the decoder orders values. A component can need several.
struct Start {
  Corner corner = 0;
  bool continues = false;  // belongs to the preceding start's component
};

// A queue with one writer and one reader, possibly on two threads. Reset it only while neither uses
// it.
class Starts {
 public:
  // There are at most `most` starts.
  void reset(std::size_t most) {
    starts_.resize_for_overwrite(most);
    state_.store(0, std::memory_order_relaxed);
  }

  void put(Start start) {
    const std::uint32_t count = state_.load(std::memory_order_relaxed);
    starts_[count] = start.corner | (start.continues ? kContinues : 0);
    state_.store(count + 1, std::memory_order_release);
    state_.notify_one();
  }

  // No starts follow.
  void close() {
    state_.fetch_or(kClosed, std::memory_order_release);
    state_.notify_one();
  }

  // Waits for the start of that index. Returns empty if the queue was closed before.
  std::optional<Start> get(std::uint32_t index) {
    for (;;) {
      const std::uint32_t state = state_.load(std::memory_order_acquire);
      if ((state & ~kClosed) > index) {
        return Start{starts_[index] & ~kContinues, (starts_[index] & kContinues) != 0};
      }
      if ((state & kClosed) != 0) return std::nullopt;
      state_.wait(state, std::memory_order_acquire);
    }
  }

 private:
  static constexpr std::uint32_t kContinues = 1U << 31;  // flag of a start
  static constexpr std::uint32_t kClosed = 1U << 31;     // flag of the state, whose other bits are
                                                         // their number

  mesh::Buffer<std::uint32_t> starts_;
  std::atomic<std::uint32_t> state_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
