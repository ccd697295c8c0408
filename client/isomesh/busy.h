// Requests to a busy server, which are sent again. Private to this folder.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <stop_token>
#include <utility>

#include "client/isomesh/client.h"
#include "client/isomesh/transport.h"

namespace isomesh {

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
  std::chrono::milliseconds pause_{500};
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
