// Sends one HTTP request at a time with libcurl, which only transport.cpp uses.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/isomesh/url.h"
#include "proto/error.h"

namespace isomesh {

struct HttpRequest {
  std::string method = "GET";
  std::string target = {};  // path and query, encoded
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::string body = {};

  // A body read in pieces instead: fills its argument with the bytes from `offset`. The same bytes
  // may be requested twice.
  std::function<void(std::uint64_t offset, std::span<char> piece)> source = {};
  std::uint64_t source_bytes = 0;

  // Takes the body of a successful response. Without it, and for errors, the body is in the
  // HttpResponse.
  std::function<void(std::string_view piece)> sink = {};
  // Called with the status before the sink's first piece.
  std::function<void(int status)> before_sink = {};

  // Added to the limit on the server's silence.
  std::chrono::milliseconds patience{0};
};

struct HttpResponse {
  int status = 0;
  std::string content_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;  // names in lower case
  // The pause until the next request that the server asked for; 0: none.
  std::chrono::seconds retry_after{0};

  // The first header of that name, given in lower case; empty if missing.
  std::string header(std::string_view name) const;
};

// kUnreachable; `broken` if the connection was established and broke, so that a retry may help.
class NoResponse : public Error {
 public:
  NoResponse(const std::string& detail, bool broken)
      : Error(ErrorCode::kUnreachable, detail), broken_(broken) {}

  bool broken() const { return broken_; }

 private:
  bool broken_;
};

struct TransportOptions {
  ServerAddress server;
  std::string server_url;  // its name in messages
  std::string token;
  std::filesystem::path authorities;                // empty: the system's
  std::chrono::milliseconds connect_timeout{0};     // 0: libcurl's default of five minutes
  std::chrono::milliseconds silence_timeout{0};     // after connecting
  std::chrono::milliseconds stall_timeout{60'000};  // the same while a source is sent
  std::stop_token stop;
};

// Constant after construction; `send` may be called from several threads. Each call has a
// connection of its own. It goes straight to the server: the environment's proxies are not used,
// because volumes and the token must not pass by a machine that the caller did not name, and
// redirects are not followed. libcurl announces bodies of more than a megabyte (Expect:
// 100-continue), so a server can reject them before they are sent.
class Transport {
 public:
  explicit Transport(TransportOptions options) : options_(std::move(options)) {}

  // Returns the response, whatever its status. Throws NoResponse; Error kCancelled on a stop
  // request, kInvalidParameter for a header with control characters, kInternal for a body larger
  // than the API's; and exceptions of source and sink.
  //
  // If the server responds before it has read the whole body, the rest is not sent.
  HttpResponse send(const HttpRequest& request) const;

 private:
  TransportOptions options_;
};

}  // namespace isomesh
