// The library's server behind connections of our own: only a request that has come holds a thread,
// and no longer than its handler works.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <httplib.h>

#include "server/http/courier.h"
#include "server/http/doorman.h"
#include "server/http/exchange.h"
#include "server/http/task_queue.h"
#include "server/http/waiting_room.h"

namespace isomesh::http {

struct FrontOptions {
  std::size_t threads = 32;   // requests that are worked on at once
  std::size_t backlog = 256;  // requests that wait for a thread
  DoormanLimits doorman;
  ExchangeLimits exchange;
  CourierLimits courier;
  StreamOf stream_of = [](int socket) { return std::make_unique<PlainStream>(socket); };
  // Told of connections that were answered without a handler: for the log.
  std::function<void(const std::string& address, const Error& error)> on_turned_away;
};

// Routes and handlers are the library's; listening, reading and sending are not.
class Front : public httplib::Server {
 public:
  // What the library has bound and set up is served from open() on.
  explicit Front(FrontOptions options) : options_(std::move(options)) {}
  ~Front() override;

  // Begins to serve; once. `has_ended` tells whether a job is over, for requests that wait for it.
  void open(WaitingRoom::HasEnded has_ended);

  // Who waits for that job is answered, and streams of events go on. Thread safe while it is open.
  void job_ended(const std::string& job);
  void something_happened();

  // Connections that have not sent their request yet, and answers that are on their way.
  std::size_t held() const { return doorman_->held(); }
  std::size_t deliveries() const { return courier_->deliveries(); }

  // No connection is accepted any more, bodies are not read on, nobody waits any more, and answers
  // are sent within `patience`. Returns when all threads have ended.
  void close(std::chrono::milliseconds patience);

 private:
  void admit(Visitor visitor);
  void turn_away(std::unique_ptr<ByteStream> stream, const std::string& address,
                 const Error& error);
  void enqueue(const std::shared_ptr<Exchange>& exchange);
  void serve(const std::shared_ptr<Exchange>& exchange);

  const FrontOptions options_;
  std::atomic<bool> stopping_ = false;
  // Each needs those before it, so they are ended from the last to the first.
  std::optional<Courier> courier_;
  std::optional<WaitingRoom> waiting_room_;
  std::optional<BoundedTaskQueue> tasks_;
  std::optional<Doorman> doorman_;
};

}  // namespace isomesh::http
