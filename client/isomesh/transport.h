// One HTTP request at a time over libcurl, which nothing outside transport.cpp sees.
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

  // A body that is read piece by piece instead: fills its argument with the bytes from `offset`,
  // and may be asked for the same ones twice.
  std::function<void(std::uint64_t offset, std::span<char> piece)> source = {};
  std::uint64_t source_bytes = 0;

  // Takes the body of a successful answer. Without it, and for refusals, the body is in the
  // HttpAnswer.
  std::function<void(std::string_view piece)> sink = {};
  // Is told the status ahead of the sink's first piece.
  std::function<void(int status)> before_sink = {};

  // How much longer than usual the server may be silent.
  std::chrono::milliseconds patience{0};
};

struct HttpAnswer {
  int status = 0;
  std::string content_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;  // names in lower case

  // The first of that name, which is in lower case; empty without one.
  std::string header(std::string_view name) const;
};

// kUnreachable, and whether the connection was there and broke: then trying again can help.
class NoAnswer : public Error {
 public:
  NoAnswer(const std::string& detail, bool broken)
      : Error(ErrorCode::kUnreachable, detail), broken_(broken) {}

  bool broken() const { return broken_; }

 private:
  bool broken_;
};

struct TransportOptions {
  ServerAddress server;
  std::string server_url;  // as messages name it
  std::string token;
  std::filesystem::path authorities;                // empty: the system's
  std::chrono::milliseconds connect_timeout{0};     // 0: five minutes, which is libcurl's
  std::chrono::milliseconds silence_timeout{0};     // from the connection on
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

  // Returns the answer, whatever its status. Throws NoAnswer; Error kCancelled when asked to stop,
  // kInvalidParameter for a header with control characters, kInternal for a body beyond what the
  // API ever sends; and what source or sink throw.
  //
  // A server that refuses before it has taken the whole body is heard: the rest is not sent.
  HttpAnswer send(const HttpRequest& request) const;

 private:
  TransportOptions options_;
};

}  // namespace isomesh
