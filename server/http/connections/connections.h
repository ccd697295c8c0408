// Connections from acceptance to the last byte of the response. A thread is held only while a
// handler works: not by slow or silent clients, not by requests that wait for a job, and not by
// responses in transit.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/net/acceptor.h"
#include "server/net/fair_places.h"
#include "server/net/incoming_body.h"
#include "server/net/parked.h"
#include "server/net/sender.h"
#include "server/net/task_queue.h"

namespace isomesh::http {

struct ConnectionOptions {
  // Open connections, from acceptance to the end of the response. An address has a fair share
  // (net::FairPlaces), as of the next two.
  std::size_t connections = 2048;
  std::size_t threads = 32;   // requests processed concurrently
  std::size_t backlog = 512;  // requests waiting for a thread
  // Requests computed concurrently (Continuation::computing_for); their backlog is the same.
  std::size_t computing_threads = 12;
  // Bytes of responses in transit to slow receivers. Beyond it, requests are rejected until the
  // bytes are sent.
  std::size_t most_response_bytes = std::size_t{256} << 20;
  // Paths of health probes. They have their own thread, which no other request blocks.
  std::vector<std::string> probes = {};
  // A client that has closed its sending direction is considered lost after this time.
  std::chrono::milliseconds client_patience{1'000};
  net::AcceptorLimits acceptor;
  net::BodyLimits body;
  net::SenderLimits sender;
  net::StreamOf stream_of = [](int socket) { return std::make_unique<net::PlainStream>(socket); };
};

struct BodySizes {
  std::uint64_t received = 0;  // bytes of the request's body
  std::uint64_t sent = 0;      // bytes of the response's body
};

// Callbacks of connections. All are called concurrently.
struct ConnectionHandlers {
  // Handles a request. Neither it nor its continuation may throw.
  std::function<std::optional<Continuation>(Request& request, Response& response)> handle;
  net::Parked::HasEnded has_ended;
  // Called for every answered request, before its response is sent. May be empty.
  std::function<void(const Request& request, const Response& response, const BodySizes& sizes)>
      on_answered;
  // Called for every connection rejected without calling `handle`. May be empty.
  std::function<void(const std::string& address, const Error& error)> on_refused;
};

class Connections {
 public:
  Connections(ConnectionOptions options, ConnectionHandlers handlers);
  // As close() with zero patience.
  ~Connections();
  Connections(const Connections&) = delete;
  Connections& operator=(const Connections&) = delete;

  // Starts serving connections of the listening socket, which the caller owns. Call once.
  void open(int listening);

  // Resumes the requests that wait for the job. Thread safe while open, like the next four.
  void job_ended(const std::string& job);
  // Polls sources that had nothing to send.
  void wake_sources();

  // Open connections; connections whose request is incomplete; responses in transit.
  std::size_t open_connections() const { return places_.taken(); }
  std::size_t pending() const { return acceptor_->pending(); }
  std::size_t sending() const { return sender_->sending(); }

  // Stops accepting connections and reading bodies, resumes all requests that wait for a job,
  // refuses those whose handler or computation has not begun, and sends responses within
  // `patience`. Returns when all threads have ended.
  void close(std::chrono::milliseconds patience);

 private:
  struct Exchange;
  using Handle = std::function<std::optional<Continuation>(Exchange& exchange)>;
  using Resume = decltype(Continuation::resume);

  void refuse(std::unique_ptr<net::ByteStream> stream, const std::string& address,
              const Error& error);
  void refuse_one_of_many(Exchange& exchange);
  void refuse_at_end(Exchange& exchange);
  bool is_probe(const Request& request) const;
  void enqueue(const std::shared_ptr<Exchange>& exchange, const Handle& handle);
  void serve(const std::shared_ptr<Exchange>& exchange, const Handle& handle);
  void park(const std::shared_ptr<Exchange>& exchange, const Continuation& continuation);
  void compute(const std::shared_ptr<Exchange>& exchange, const Continuation& continuation);
  void go_on(const std::shared_ptr<Exchange>& exchange, const Resume& resume);
  void finish_by(const std::shared_ptr<Exchange>& exchange, const Resume& resume);

  const ConnectionOptions options_;
  const ConnectionHandlers handlers_;
  std::atomic<bool> stopping_ = false;
  // Each member uses the previous ones, so the order of destruction matters.
  net::FairPlaces places_;
  std::optional<net::Sender> sender_;
  std::optional<net::Parked> parked_;
  std::optional<net::BoundedTaskQueue> computing_;
  std::optional<net::BoundedTaskQueue> tasks_;
  std::optional<net::BoundedTaskQueue> probes_;
  std::optional<net::Acceptor> acceptor_;
};

}  // namespace isomesh::http
