// Where the order of values starts, handed from the traversal to whoever makes the order; private
// to this folder.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/scratch.h"

namespace isomesh::codec::edgebreaker {

// A corner from which the decoder orders values. A component can need several.
struct Start {
  Corner corner = 0;
  bool continues = false;  // the component of the start before
};

// A queue with one writer and one reader, which may be on two threads; reset while neither is.
class Starts {
 public:
  // There are at most `most` starts.
  void reset(std::size_t most) {
    starts_.reserve(most);
    state_.store(0, std::memory_order_relaxed);
  }

  void put(Start start) {
    const std::uint32_t count = state_.load(std::memory_order_relaxed);
    starts_[count] = start.corner | (start.continues ? kContinues : 0);
    state_.store(count + 1, std::memory_order_release);
    state_.notify_one();
  }

  // Nothing comes any more.
  void close() {
    state_.fetch_or(kClosed, std::memory_order_release);
    state_.notify_one();
  }

  // The start of that index; waits for it. None when the queue was closed before it came.
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
  static constexpr std::uint32_t kContinues = 1U << 31;  // of a start
  static constexpr std::uint32_t kClosed = 1U << 31;     // of the state, which else counts them

  Scratch<std::uint32_t> starts_;
  std::atomic<std::uint32_t> state_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
