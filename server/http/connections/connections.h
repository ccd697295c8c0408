// Connections from their acceptance to the last byte of their response. A thread is held only while
// a handler works: not by clients that are slow or silent, not by requests that wait for a job, and
// not by responses on their way.
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
  // Connections that are open, from their acceptance to the end of their response. An address has
  // its share of them (net::FairPlaces), as of the next two.
  std::size_t connections = 2048;
  std::size_t threads = 32;   // requests that are worked on at once
  std::size_t backlog = 512;  // requests that wait for a thread
  // Of those that are computed (Continuation::computing_for), how many at once; as many as the
  // others may wait.
  std::size_t computing_threads = 12;
  // Of answers that are on their way to slow receivers: with more, requests are refused until they
  // have gone.
  std::size_t most_answer_bytes = std::size_t{256} << 20;
  // Paths that orchestrators ask whether the service lives. They have a thread of their own, which
  // waits for no other request.
  std::vector<std::string> probes = {};
  // A client that ends its own sending is waited with for so long; then it is taken for gone.
  std::chrono::milliseconds client_patience{1'000};
  net::AcceptorLimits acceptor;
  net::BodyLimits body;
  net::SenderLimits sender;
  net::StreamOf stream_of = [](int socket) { return std::make_unique<net::PlainStream>(socket); };
};

struct BodySizes {
  std::uint64_t received = 0;  // bytes of the request's body
  std::uint64_t sent = 0;      // bytes of the response's
};

// What connections need to know. All functions are called by several threads at once.
struct ConnectionHandlers {
  // Answers a request. Must not throw, nor must the continuation's.
  std::function<std::optional<Continuation>(Request& request, Response& response)> answer;
  // Whether a job has ended, or does not exist.
  net::Parked::HasEnded has_ended;
  // Told of every request that was answered, before its response is sent. May be empty.
  std::function<void(const Request& request, const Response& response, const BodySizes& sizes)>
      on_answered;
  // Told of every connection that was refused without calling `answer`. May be empty.
  std::function<void(const std::string& address, const Error& error)> on_refused;
};

class Connections {
 public:
  Connections(ConnectionOptions options, ConnectionHandlers handlers);
  // As close() without patience.
  ~Connections();
  Connections(const Connections&) = delete;
  Connections& operator=(const Connections&) = delete;

  // Begins to serve connections to that listening socket, which stays the caller's; once.
  void open(int listening);

  // Requests that wait for that job are answered. Thread safe while it is open, as the next four.
  void job_ended(const std::string& job);
  // Sources that had nothing to send are asked again.
  void wake_sources();

  // Connections that are open; of those, whose request has not come yet, and responses on their
  // way.
  std::size_t open_connections() const { return places_.taken(); }
  std::size_t pending() const { return acceptor_->pending(); }
  std::size_t sending() const { return sender_->sending(); }

  // No connection is accepted any more, bodies are not read on, nobody waits any more, and
  // responses are sent within `patience`. Returns when all threads have ended.
  void close(std::chrono::milliseconds patience);

 private:
  struct Exchange;
  using Answer = std::function<std::optional<Continuation>(Exchange& exchange)>;
  using Resume = decltype(Continuation::resume);

  void refuse(std::unique_ptr<net::ByteStream> stream, const std::string& address,
              const Error& error);
  void refuse_one_of_many(Exchange& exchange);
  bool is_probe(const Request& request) const;
  void enqueue(const std::shared_ptr<Exchange>& exchange, const Answer& answer);
  void serve(const std::shared_ptr<Exchange>& exchange, const Answer& answer);
  void park(const std::shared_ptr<Exchange>& exchange, const Continuation& continuation);
  void compute(const std::shared_ptr<Exchange>& exchange, const Continuation& continuation);
  void go_on(const std::shared_ptr<Exchange>& exchange, const Resume& resume);
  void answer_by(const std::shared_ptr<Exchange>& exchange, const Resume& resume);

  const ConnectionOptions options_;
  const ConnectionHandlers handlers_;
  std::atomic<bool> stopping_ = false;
  // Each uses those before it, so they end from the last to the first.
  net::FairPlaces places_;
  std::optional<net::Sender> sender_;
  std::optional<net::Parked> parked_;
  std::optional<net::BoundedTaskQueue> computing_;
  std::optional<net::BoundedTaskQueue> tasks_;
  std::optional<net::BoundedTaskQueue> probes_;
  std::optional<net::Acceptor> acceptor_;
};

}  // namespace isomesh::http
