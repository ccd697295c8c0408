// When to give an upload up that does not get on. Private to this folder.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

namespace isomesh {

// The outage begins with the first failure after progress. A part that fails may have been received
// in part, which only the server knows. So nothing is given up before it was asked.
class Patience {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Patience(std::function<Clock::time_point()> now = Clock::now) : now_(std::move(now)) {}

  // Call after each failure, of a part or of a question.
  void fail() {
    if (!cut_at_) cut_at_ = now_();
  }

  // Call with each answer of the server.
  void hear(std::uint64_t offset) {
    if (offset > reached_) {
      cut_at_.reset();
      pause_ = kFirstPause;
    }
    reached_ = offset;
  }

  // Call with the time for which the client waits because the server is busy, which is no outage.
  void excuse(std::chrono::milliseconds busy) {
    if (cut_at_) *cut_at_ += busy;
  }

  // Call after a question that failed, or whose answer was heard.
  bool is_over() const { return cut_at_ && now_() - *cut_at_ >= kLongestCut; }

  std::chrono::milliseconds next_pause() {
    return std::exchange(pause_, std::min(2 * pause_, kLongestPause));
  }

  // The longest outage. A restart of the daemon takes a few seconds.
  static constexpr std::chrono::milliseconds kLongestCut{60'000};

 private:
  static constexpr std::chrono::milliseconds kFirstPause{100};
  static constexpr std::chrono::milliseconds kLongestPause{3'000};

  std::function<Clock::time_point()> now_;
  std::optional<Clock::time_point> cut_at_;
  std::uint64_t reached_ = 0;
  std::chrono::milliseconds pause_ = kFirstPause;
};

}  // namespace isomesh
