#include "server/http/connections/connections.h"

#include <algorithm>
#include <chrono>
#include <string_view>
#include <utility>

#include <poll.h>

#include "base/niceness.h"
#include "server/http/connections/httplib_adapter.h"
#include "server/net/address.h"

namespace isomesh::http {
namespace {

Request request_of(net::Connection& connection) {
  Request request;
  request.method = std::move(connection.head.method);
  request.target = std::move(connection.head.target);
  request.version = std::move(connection.head.version);
  request.headers = std::move(connection.head.headers);
  request.content_length = connection.framing.length;
  request.remote_address = std::move(connection.address);
  return request;
}

}  // namespace

struct Connections::Exchange {
  Exchange(net::Connection connection, const net::BodyLimits& limits,
           const std::atomic<bool>& stopping)
      : party(net::party_of(connection.address)),
        body(connection, limits, stopping),
        request(request_of(connection)) {}

  // True if the client has disconnected and the request is a read that has waited for at least
  // `patience`. A client may close its sending direction and still read, so requests that did not
  // wait are answered.
  bool is_abandoned(std::chrono::milliseconds patience) const {
    const bool only_reads = request.method == "GET" || request.method == "HEAD";
    if (!only_reads || std::chrono::steady_clock::now() - arrived < patience) return false;
    pollfd connection = {body.descriptor(), POLLRDHUP, 0};
    return ::poll(&connection, 1, 0) == 1 &&
           (connection.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
  }

  const std::chrono::steady_clock::time_point arrived = std::chrono::steady_clock::now();
  std::string party;
  net::IncomingBody body;
  Request request;
  Response response;
};

Connections::Connections(ConnectionOptions options, ConnectionHandlers handlers)
    : options_(std::move(options)),
      handlers_(std::move(handlers)),
      places_(options_.connections, "connections") {}

Connections::~Connections() { close(std::chrono::milliseconds(0)); }

void Connections::open(int listening) {
  sender_.emplace(options_.sender);
  computing_.emplace(options_.computing_threads, options_.backlog, kComputingNiceness);
  tasks_.emplace(options_.threads, options_.backlog);
  probes_.emplace(1, options_.backlog);
  parked_.emplace(handlers_.has_ended);
  acceptor_.emplace(
      listening, options_.acceptor, places_, options_.stream_of,
      [this](net::Connection connection) {
        enqueue(std::make_shared<Exchange>(std::move(connection), options_.body, stopping_),
                [this](Exchange& exchange) {
                  return handlers_.handle(exchange.request, exchange.response);
                });
      },
      [this](std::unique_ptr<net::ByteStream> stream, const std::string& address,
             const Error& error) { refuse(std::move(stream), address, error); });
}

void Connections::job_ended(const std::string& job) { parked_->job_ended(job); }

void Connections::wake_sources() { sender_->wake(); }

void Connections::close(std::chrono::milliseconds patience) {
  stopping_ = true;
  if (acceptor_) acceptor_->stop();
  if (parked_) parked_->close();
  if (tasks_) tasks_->shutdown();
  if (probes_) probes_->shutdown();
  if (computing_) computing_->shutdown();
  if (sender_) sender_->stop(patience);
}

void Connections::refuse(std::unique_ptr<net::ByteStream> stream, const std::string& address,
                         const Error& error) {
  if (handlers_.on_refused) handlers_.on_refused(address, error);
  sender_->send(
      {.stream = std::move(stream), .bytes = refusal(error), .source = nullptr, .is_refusal = true},
      false);
}

void Connections::refuse_one_of_many(Exchange& exchange) {
  refuse(exchange.body.take_stream(), exchange.request.remote_address,
         {ErrorCode::kUnavailable, "too many requests are in progress"});
}

void Connections::refuse_at_end(Exchange& exchange) {
  refuse(exchange.body.take_stream(), exchange.request.remote_address,
         {ErrorCode::kUnavailable, "the service is shutting down"});
}

void Connections::enqueue(const std::shared_ptr<Exchange>& exchange, const Handle& handle) {
  const bool is_for_probes = is_probe(exchange->request);
  if (!is_for_probes && sender_->held_bytes() > options_.most_response_bytes) {
    return refuse(
        exchange->body.take_stream(), exchange->request.remote_address,
        {ErrorCode::kUnavailable, "too many responses are on their way to slow receivers"});
  }
  net::BoundedTaskQueue& queue = is_for_probes ? *probes_ : *tasks_;
  // The whole backlog would hold up the end of the service for long.
  const auto begin = [this, exchange, handle] {
    stopping_ ? refuse_at_end(*exchange) : serve(exchange, handle);
  };
  if (!queue.try_enqueue(exchange->party, begin)) refuse_one_of_many(*exchange);
}

bool Connections::is_probe(const Request& request) const {
  const std::string_view path =
      std::string_view(request.target).substr(0, request.target.find('?'));
  return std::ranges::find(options_.probes, path) != options_.probes.end();
}

void Connections::serve(const std::shared_ptr<Exchange>& exchange, const Handle& handle) {
  if (exchange->is_abandoned(options_.client_patience)) return;
  std::optional<Continuation> continuation;
  WrittenResponse written =
      run_through_httplib(exchange->request, exchange->body, exchange->response,
                          [&] { continuation = handle(*exchange); });
  if (continuation && continuation->computing_for) return compute(exchange, *continuation);
  if (continuation) return park(exchange, *continuation);
  if (handlers_.on_answered) {
    handlers_.on_answered(exchange->request, exchange->response,
                          {.received = exchange->body.received(), .sent = written.body_bytes});
  }
  auto source = exchange->response.stream ? std::move(exchange->response.stream->source) : nullptr;
  const bool is_whole = exchange->body.is_whole();
  sender_->send({.stream = exchange->body.take_stream(),
                 .bytes = std::move(written.bytes),
                 .source = std::move(source),
                 .party = exchange->party},
                is_whole);
}

void Connections::park(const std::shared_ptr<Exchange>& exchange,
                       const Continuation& continuation) {
  net::ParkedRequest parked = {
      .job = continuation.job,
      .until = continuation.until,
      .resume = [this, exchange, resume = continuation.resume] { go_on(exchange, resume); },
      .descriptor = exchange->body.descriptor()};
  if (continuation.abandoned) {
    parked.abandoned = [this, exchange, abandoned = continuation.abandoned] {
      tasks_->enqueue_rest(exchange->party,
                           [exchange, abandoned] { abandoned(exchange->request); });
    };
  }
  parked_->park(std::move(parked));
}

// A client is identified by its owner from here on, before only by its address.
void Connections::compute(const std::shared_ptr<Exchange>& exchange,
                          const Continuation& continuation) {
  exchange->party = *continuation.computing_for;
  const auto begin = [this, exchange, resume = continuation.resume] {
    stopping_ ? refuse_at_end(*exchange) : finish_by(exchange, resume);
  };
  if (!computing_->try_enqueue(exchange->party, begin)) refuse_one_of_many(*exchange);
}

// Enters the library once more to write the response.
void Connections::finish_by(const std::shared_ptr<Exchange>& exchange, const Resume& resume) {
  serve(exchange, [&resume](Exchange& waited) {
    resume(waited.request, waited.response);
    return std::optional<Continuation>();
  });
}

// An accepted request is queued regardless of the backlog. One that begins to wait after the queue
// has ended is finished here, on the thread of its handler.
void Connections::go_on(const std::shared_ptr<Exchange>& exchange, const Resume& resume) {
  const bool has_turn = tasks_->enqueue_rest(
      exchange->party, [this, exchange, resume] { finish_by(exchange, resume); });
  if (!has_turn) finish_by(exchange, resume);
}

}  // namespace isomesh::http
