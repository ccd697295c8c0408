// How long the client waits: between attempts, for a server that is busy, and until an upload is
// given up. Private to this folder.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <utility>

#include "client/isomesh/client.h"
#include "client/isomesh/transport.h"

namespace isomesh {

// The duration of one long poll.
inline constexpr std::chrono::seconds kLongestWait{30};
// The minimum interval between polls, for a server that answers long polls immediately.
inline constexpr std::chrono::milliseconds kShortestLook{200};
// How often a request that may be repeated is sent if its connection breaks.
inline constexpr int kTries = 4;

// Pauses that double.
class Backoff {
 public:
  constexpr Backoff(std::chrono::milliseconds first, std::chrono::milliseconds longest)
      : first_(first), longest_(longest), next_(first) {}

  std::chrono::milliseconds next() { return std::exchange(next_, std::min(2 * next_, longest_)); }
  void restart() { next_ = first_; }

 private:
  std::chrono::milliseconds first_;
  std::chrono::milliseconds longest_;
  std::chrono::milliseconds next_;
};

// After a broken connection.
inline constexpr Backoff kBroken{std::chrono::milliseconds{100}, std::chrono::seconds{3}};
// After a refusal by a busy server that does not say how long to wait.
inline constexpr Backoff kBusy{std::chrono::milliseconds{500}, std::chrono::seconds{15}};

// Least random part of a pause that the server asks for: a quarter of a second would spread few
// clients.
inline constexpr std::chrono::milliseconds kLeastJitter{500};

// Returns after `duration`. Throws Error kCancelled immediately on a stop request.
void pause(std::chrono::milliseconds duration, const std::stop_token& stop);

// Time and chance.
struct Waiting {
  using Clock = std::chrono::steady_clock;

  std::function<Clock::time_point()> now = Clock::now;
  std::function<double()> random;  // from 0 to 1
  std::function<void(std::chrono::milliseconds, const std::stop_token&)> pause = isomesh::pause;

  static Waiting real();
};

// The pauses of one request. Clients that were refused at the same time must not return at the same
// time, so all pauses are random in part.
class BusyWait {
 public:
  // `limit`: from the first refusal to the last attempt.
  BusyWait(std::chrono::milliseconds limit, Waiting waiting)
      : limit_(limit), waiting_(std::move(waiting)) {}

  // Call after each refusal. The server asked for `retry_after`; 0: for no pause, so each is twice
  // as long as the one before. Empty if the time does not last until then.
  std::optional<std::chrono::milliseconds> next_pause(std::chrono::seconds retry_after);

 private:
  std::chrono::milliseconds pause_after(std::chrono::seconds retry_after);

  std::chrono::milliseconds limit_;
  Waiting waiting_;
  std::optional<Waiting::Clock::time_point> refused_at_;
  Backoff backoff_ = kBusy;
};

// When to give an upload up that does not get on. The outage begins with the first failure after
// progress. A part that fails may have been received in part, which only the server knows. So
// nothing is given up before it was asked.
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
    if (offset <= reached_) return;  // also one that was reached before, and lost
    cut_at_.reset();
    backoff_.restart();
    reached_ = offset;
  }

  // Call with the time for which the client waits because the server is busy, which is no outage.
  void excuse(std::chrono::milliseconds busy) {
    if (cut_at_) *cut_at_ += busy;
  }

  // Call after a question that failed, or whose answer was heard.
  bool is_over() const { return cut_at_ && now_() - *cut_at_ >= kLongestCut; }

  std::chrono::milliseconds next_pause() { return backoff_.next(); }

  // The longest outage. A restart of the daemon takes a few seconds.
  static constexpr std::chrono::milliseconds kLongestCut{60'000};

 private:
  std::function<Clock::time_point()> now_;
  std::optional<Clock::time_point> cut_at_;
  std::uint64_t reached_ = 0;
  Backoff backoff_ = kBroken;
};

struct PersistenceOptions {
  std::chrono::milliseconds retry_timeout{0};
  BusyListener busy = {};
  std::stop_token stop = {};
  Waiting waiting = Waiting::real();
};

// A Transport that sends a request again while the server is busy (429 or 503). Every request of
// the API may be repeated then: most are refused before they are looked at, and the others change
// nothing more the second time. Every body can be sent again, because HttpRequest::source gives any
// of its bytes twice. Constant after construction; thread safe.
class PersistentTransport {
 public:
  PersistentTransport(TransportOptions transport, PersistenceOptions options)
      : transport_(std::move(transport)), options_(std::move(options)) {}

  // As Transport::send. `excuse` gets each pause before it begins. The response is 429 or 503 if
  // the server is still busy at the end of the time.
  HttpResponse send(const HttpRequest& request,
                    const std::function<void(std::chrono::milliseconds)>& excuse = {}) const;

 private:
  Transport transport_;
  PersistenceOptions options_;
};

}  // namespace isomesh
