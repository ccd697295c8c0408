// What a handler answers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "server/http/requests/request.h"
#include "server/net/sender.h"

namespace isomesh::http {

// How a receiver finds the end of a body that a source makes.
enum class Framing {
  kLength,  // by Content-Length
  kChunks,  // the source makes chunks (RFC 9112, 7.1)
  kUntilConnectionEnds,
};

// A body that is made while it is sent.
struct StreamedBody {
  std::unique_ptr<net::Source> source;
  std::string media_type;
  Framing framing = Framing::kLength;
  std::uint64_t length = 0;  // with kLength: what the source makes, not 0
};

struct Response {
  int status = 200;
  net::Headers headers;
  std::string media_type;
  std::string body;                    // compressed on its way when the client takes that
  std::optional<StreamedBody> stream;  // instead of `body`; sent as it is

  bool has_header(std::string_view name) const;
  // Replaces the headers of that name.
  void set_header(std::string_view name, std::string_view value);
  // Adds one more, for names that may come several times, such as Vary.
  void add_header(std::string_view name, std::string_view value);
  void set_body(std::string text, std::string_view type);
};

// What a handler leaves to be done instead of answering: `resume` answers when the job has ended,
// or at `until` whatever has become of the job. No thread is held until then. With `computing_for`
// there is no job: `resume` answers on a thread that computes, when it is that party's turn.
struct Continuation {
  std::string job = {};
  std::chrono::steady_clock::time_point until = {};
  std::function<void(const Request& request, Response& response)> resume;
  // Called once, before `resume`, when the client has gone meanwhile. Without it `resume` is, since
  // there is nobody to wait for.
  std::function<void(const Request& request)> abandoned = {};
  std::optional<std::string> computing_for = {};
};

// Answers, or leaves that to a continuation. May throw: Error becomes the problem that it names,
// anything else is logged and becomes kInternal. Called by several threads at once.
using Handler = std::function<std::optional<Continuation>(const Request&, Response&)>;

// Makes the response the problem (RFC 9457) that the error is.
void answer_problem(const Request& request, Response& response, const Error& error);

// The whole response, as bytes, to a connection whose request could not be taken.
std::string refusal(const Error& error);

}  // namespace isomesh::http
