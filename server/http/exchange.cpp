#include "server/http/exchange.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <utility>

#include <strings.h>

#include "proto/json.h"

namespace isomesh::http {
namespace {

constexpr int kLookUpMilliseconds = 100;  // how soon the end of the service is seen

thread_local Exchange* serving = nullptr;

// The library answers other methods before anybody can say that they are not allowed.
std::string known_method(const std::string& method) {
  static const std::set<std::string> known = {"GET",    "HEAD",    "POST", "PUT",
                                              "DELETE", "OPTIONS", "PATCH"};
  return known.contains(method) ? method : "TRACE";
}

// The library refuses a second question mark, which is an ordinary character of a query.
std::string tame(const std::string& target) {
  std::string result;
  for (std::size_t at = 0, query = target.find('?'); at < target.size(); ++at) {
    if (target[at] == '?' && at > query) {
      result += "%3F";
    } else {
      result += target[at];
    }
  }
  return result;
}

// What the library adds to a request by itself, and then takes for its own.
bool is_reserved(const std::string& name) {
  constexpr std::array kReserved = {"REMOTE_ADDR", "REMOTE_PORT", "LOCAL_ADDR", "LOCAL_PORT"};
  return std::ranges::any_of(
      kReserved, [&](const char* reserved) { return ::strcasecmp(reserved, name.c_str()) == 0; });
}

}  // namespace

Exchange::Exchange(Visitor visitor, const ExchangeLimits& limits, const std::atomic<bool>& stopping)
    : visitor_(std::move(visitor)),
      limits_(limits),
      stopping_(stopping),
      line_(known_method(visitor_.head.method) + ' ' + tame(visitor_.head.target) +
            " HTTP/1.1\r\n\r\n"),
      received_(visitor_.body.size()) {}

Exchange* Exchange::current() { return serving; }

Exchange::Serving::Serving(Exchange& exchange) { serving = &exchange; }
Exchange::Serving::~Serving() { serving = nullptr; }

void Exchange::introduce(httplib::Request& request) const {
  request.method = visitor_.head.method;
  request.target = visitor_.head.target;
  request.version = visitor_.head.version;
  request.headers.clear();
  for (const auto& [name, value] : visitor_.head.headers) {
    // "100-continue" is answered when the body is read, not before anybody knows whether it is
    // wanted.
    const bool is_expect = ::strcasecmp(name.c_str(), "Expect") == 0;
    if (!is_reserved(name) && !is_expect) request.headers.emplace(name, value);
  }
}

void Exchange::resume() {
  resumed_ = std::exchange(parking_, std::nullopt);
  answer_.clear();
  source_.reset();
  line_read_ = 0;
  body_read_ = 0;
}

ssize_t Exchange::read(char* target, std::size_t size) {
  if (line_read_ == line_.size()) return read_body(target, size);
  const std::size_t count = line_.copy(target, size, line_read_);
  line_read_ += count;
  return static_cast<ssize_t>(count);
}

ssize_t Exchange::read_body(char* target, std::size_t size) {
  if (body_read_ < visitor_.body.size()) {
    const std::size_t count = visitor_.body.copy(target, size, body_read_);
    body_read_ += count;
    return static_cast<ssize_t>(count);
  }
  using Clock = std::chrono::steady_clock;
  invite_body();
  if (!deadline_) deadline_ = Clock::now() + limits_.patience;
  while (true) {
    const Transfer transfer = visitor_.stream->read({target, size});
    if (transfer.state == Transfer::State::kClosed) return 0;
    if (transfer.state == Transfer::State::kDone) {
      received_ += transfer.bytes;
      since_deadline_ += transfer.bytes;
      if (since_deadline_ >= kLeastBytes) {
        since_deadline_ = 0;
        deadline_ = Clock::now() + limits_.patience;
      }
      return static_cast<ssize_t>(transfer.bytes);
    }
    was_too_slow_ = Clock::now() >= *deadline_;
    if (stopping_ || was_too_slow_) return -1;
    wait_for(*visitor_.stream, transfer.state, kLookUpMilliseconds);
  }
}

// A body that is asked for before it is sent is invited once somebody wants to read it.
void Exchange::invite_body() {
  if (std::exchange(invited_, true) || received_ > 0) return;
  const std::string* expect = visitor_.head.find("Expect");
  if (expect == nullptr || ::strcasecmp(expect->c_str(), "100-continue") != 0) return;
  // A few bytes, the first of this connection: they fit, or the client does without.
  visitor_.stream->write("HTTP/1.1 100 Continue\r\n\r\n");
}

ssize_t Exchange::write(const char* bytes, std::size_t size) {
  answer_.append(bytes, size);
  return static_cast<ssize_t>(size);
}

void Exchange::get_remote_ip_and_port(std::string& ip, int& port) const {
  ip = visitor_.address;
  port = 0;
}

void Exchange::get_local_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

bool Exchange::has_whole_body() const {
  if (visitor_.framing.chunked) return false;  // where it ends is the library's secret
  return received_ >= visitor_.framing.length.value_or(0);
}

void Exchange::finish(Courier& courier) {
  std::string_view left = answer_;
  while (!left.empty()) {
    const Transfer transfer = visitor_.stream->write(left);
    if (transfer.state == Transfer::State::kClosed) return;
    if (transfer.state != Transfer::State::kDone) break;
    left.remove_prefix(transfer.bytes);
  }
  if (left.empty() && !source_ && has_whole_body()) {
    visitor_.stream->finish_writing();
    // Nothing more is to come, so closing it destroys nothing.
    std::array<char, 1> more = {};
    if (visitor_.stream->read(more).state != Transfer::State::kDone) return;
  }
  courier.send({std::move(visitor_.stream), std::string(left), std::move(source_)});
}

std::string Exchange::error_answer(const Error& error) {
  const Problem problem = to_problem(error, "");
  const std::string body = to_json(problem);
  std::string answer = "HTTP/1.1 " + std::to_string(problem.status) + ' ' + problem.title +
                       "\r\nCache-Control: no-store\r\nConnection: close\r\n"
                       "Content-Type: application/problem+json\r\n"
                       "X-Content-Type-Options: nosniff\r\nContent-Length: " +
                       std::to_string(body.size()) + "\r\n";
  if (problem.status == 503) answer += "Retry-After: 1\r\n";
  return answer + "\r\n" + body;
}

}  // namespace isomesh::http
