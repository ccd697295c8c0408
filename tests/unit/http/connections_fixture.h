// The connection layer with handlers of a test's own.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "server/http/connections/connections.h"
#include "server/http/requests/router.h"
#include "server/net/address.h"
#include "server/net/listener.h"
#include "tests/api/http.h"
#include "tests/support/process.h"

namespace isomesh::http::fixture {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using isomesh::test::Answer;
using isomesh::test::answer_to;
using isomesh::test::chunked;
using isomesh::test::Connection;
using isomesh::test::eventually;
using isomesh::test::request;

// Endless words, at once or when the test says so.
class Words : public net::Source {
 public:
  explicit Words(std::atomic<int>& said) : said_(said) {}

  More next(std::string& bytes) override {
    if (heard_ >= said_) return More::kLater;
    ++heard_;
    bytes += "word\n";
    return More::kBytes;
  }
  bool ends_with_reader() const override { return true; }

 private:
  std::atomic<int>& said_;
  int heard_ = 0;
};

// Many bytes, counted.
class Flood : public net::Source {
 public:
  explicit Flood(std::atomic<std::size_t>& made) : made_(made) {}

  More next(std::string& bytes) override {
    bytes.assign(64 * 1024, 'x');
    made_ += bytes.size();
    return More::kBytes;
  }

 private:
  std::atomic<std::size_t>& made_;
};

// One word, which takes until the gate opens.
class Thought : public net::Source {
 public:
  explicit Thought(std::shared_future<void> gate) : gate_(std::move(gate)) {}

  bool computes() const override { return true; }
  More next(std::string& bytes) override {
    if (has_said_) return More::kEnd;
    gate_.wait();
    has_said_ = true;
    bytes += "thought";
    return More::kBytes;
  }

 private:
  const std::shared_future<void> gate_;
  bool has_said_ = false;
};

class ConnectionsTest : public testing::Test {
 protected:
  ~ConnectionsTest() override {
    if (connections_) connections_->close(1s);
  }

  // Few threads, so that whoever holds one is noticed.
  static ConnectionOptions options() {
    ConnectionOptions options;
    options.threads = 4;
    return options;
  }

  // Nobody is given up, so that whoever waits for a thread that is held has no answer.
  static ConnectionOptions patient_options() {
    ConnectionOptions patient = options();
    patient.acceptor.head_time = 1h;
    patient.body.patience = 1h;
    patient.sender.patience = 1h;
    patient.client_patience = 1h;
    return patient;
  }

  void open(const ConnectionOptions& options) {
    add_routes();
    connections_.emplace(
        options, ConnectionHandlers{
                     .handle = [this](Request& request,
                                      Response& response) { return answer(request, response); },
                     .has_ended = [this](const auto&) { return ended_.load(); },
                     .on_answered = {},
                     .on_refused = {}});
    connections_->open(listener_.descriptor());
  }

  std::optional<Continuation> answer(const Request& request, Response& response) const {
    const auto [route, parameters] = router_.find(request.path);
    if (route != nullptr) {
      const auto handler = route->handlers().find(request.method);
      if (handler != route->handlers().end()) return handler->second(request, response);
    }
    response.status = 404;
    return std::nullopt;
  }

  template <class Run>
  void add(const std::string& method, const std::string& path, const Run& run) {
    router_.add(method, path, handler_of(run));
  }

  void add_routes() {
    for (const char* method : {"GET", "HEAD"}) {
      add(method, "/status",
          [](const Request&, Response& response) { response.set_body("ok", "text/plain"); });
    }
    add("GET", "/words", [this](const Request&, Response& response) {
      response.stream = {std::make_unique<Words>(said_), "text/plain",
                         Framing::kUntilConnectionEnds, 0};
    });
    add("GET", "/large", [](const Request&, Response& response) {
      response.set_body(std::string(std::size_t{12} << 20, 'x'), "text/plain");
    });
    add("POST", "/do", [this](const Request&, Response& response) {
      ++runs_;
      response.set_body("done", "text/plain");
    });
    add("GET", "/flood", [this](const Request&, Response& response) {
      response.stream = {std::make_unique<Flood>(made_), "text/plain", Framing::kLength,
                         std::uint64_t{1} << 40};
    });
    add("GET", "/wait", [this](const Request&, Response&) -> std::optional<Continuation> {
      ++runs_;
      return Continuation{"job", Clock::now() + wait_, [this](const Request&, Response& response) {
                            ++resumed_;
                            response.set_body("waited", "text/plain");
                          }};
    });
    add("GET", "/block-and-wait",
        [this, gate = going_.get_future().share()](const Request&,
                                                   Response&) -> std::optional<Continuation> {
          busy_ = true;
          gate.wait();
          return Continuation{"job", Clock::now() + wait_, [](const Request&, Response& response) {
                                response.set_body("waited", "text/plain");
                              }};
        });
    add("GET", "/cancel", [this](const Request&, Response&) -> std::optional<Continuation> {
      ++runs_;
      return Continuation{"job", Clock::now() + wait_,
                          [this](const Request&, Response&) { ++resumed_; },
                          [this](const Request&) {
                            ++cancelled_;
                            connections_->job_ended("job");
                          }};
    });
    add("GET", "/block",
        [this, gate = go_.get_future().share()](const Request&, Response& response) {
          busy_ = true;
          gate.wait();
          response.set_body("done", "text/plain");
        });
    add("GET", "/think", [gate = thinking_.get_future().share()](const Request&, Response& out) {
      out.stream = {std::make_unique<Thought>(gate), "text/plain", Framing::kUntilConnectionEnds,
                    0};
    });
    add("GET", "/think-fast", [](const Request&, Response& out) {
      std::promise<void> known;
      known.set_value();
      out.stream = {std::make_unique<Thought>(known.get_future().share()), "text/plain",
                    Framing::kUntilConnectionEnds, 0};
    });
    // Computed, and answered with how nice the thread is that does that.
    const auto compute = [this](const std::shared_future<void>& gate) {
      return [this, gate](const Request& asked, Response&) -> std::optional<Continuation> {
        return Continuation{.resume =
                                [this, gate](const Request&, Response& response) {
                                  ++runs_;
                                  gate.wait();
                                  response.set_body(std::to_string(::getpriority(PRIO_PROCESS, 0)),
                                                    "text/plain");
                                },
                            .computing_for = net::party_of(asked.remote_address)};
      };
    };
    std::promise<void> open;
    open.set_value();
    add("GET", "/compute", compute(computing_.get_future().share()));
    add("GET", "/compute-fast", compute(open.get_future().share()));
    add("GET", "/query", [](const Request& request, Response& response) {
      std::string text;
      for (const auto& [name, value] : request.query) text += '<' + name + '=' + value + '>';
      response.set_body(text, "text/plain");
    });
    add("POST", "/body", [this](const Request& request, Response& response) {
      std::size_t size = 0;
      const bool whole = request.body->read([&](std::string_view piece) {
        size += piece.size();
        body_bytes_ += piece.size();
        return true;
      });
      const bool slow = request.body->was_too_slow();
      const bool malformed = request.body->was_malformed();
      response.set_body((whole       ? "whole "
                         : slow      ? "slow "
                         : malformed ? "malformed "
                                     : "cut ") +
                            std::to_string(size),
                        "text/plain");
    });
  }

  Answer get(const std::string& path, const std::string& from = {}) {
    return answer_to(url_, request("GET", path), from);
  }

  // Connections that have sent that much and nothing more.
  void hang_on(int count, const std::string& bytes, const std::string& from = {}) {
    for (int n = 0; n < count; ++n) clients_.emplace_back(url_, from).send(bytes);
  }

  // Opens with a single thread, which is busy until go_ is set, and no patience for clients that
  // have gone. False if that fails.
  bool open_with_busy_thread() {
    ConnectionOptions one = options();
    one.threads = 1;
    one.client_patience = 0ms;
    open(one);
    hang_on(1, request("GET", "/block"));
    return eventually([&] { return busy_.load(); });
  }

  net::Listener listener_{net::parse_address("127.0.0.1:0")};
  const std::string url_ = "http://" + listener_.authority();
  Router router_;
  std::atomic<int> said_ = 0;
  std::atomic<std::size_t> made_ = 0;
  std::atomic<int> runs_ = 0;
  std::atomic<std::size_t> body_bytes_ = 0;  // that handlers of /body have read
  std::atomic<int> resumed_ = 0;
  std::atomic<int> cancelled_ = 0;
  std::atomic<bool> ended_ = false;
  std::atomic<bool> busy_ = false;
  std::promise<void> go_;
  std::promise<void> going_;
  std::promise<void> thinking_;
  std::promise<void> computing_;
  std::chrono::milliseconds wait_ = 60s;
  std::deque<Connection> clients_;
  std::optional<Connections> connections_;
};

}  // namespace isomesh::http::fixture
