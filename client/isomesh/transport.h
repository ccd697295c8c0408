// One HTTP exchange at a time over cpp-httplib, which nothing outside transport.cpp sees.
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

struct Exchange {
  std::string method = "GET";
  std::string target = {};  // path and query, encoded
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::string body = {};

  // A body that is read piece by piece instead: fills its argument with the bytes from `offset`.
  std::function<void(std::uint64_t offset, std::span<char> piece)> source = {};
  std::uint64_t source_bytes = 0;

  // Takes the body of a successful answer; without it, and for refusals, the body is in the Answer.
  std::function<void(std::string_view piece)> sink = {};

  // How much longer than usual the server may be silent.
  std::chrono::milliseconds patience{0};
};

struct Answer {
  int status = 0;
  std::string content_type;
  std::string body;
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
  std::filesystem::path authorities;  // empty: the system's
  std::chrono::milliseconds connect_timeout{0};
  std::chrono::milliseconds silence_timeout{0};
  std::stop_token stop;
};

// Constant after construction; `send` may be called from several threads.
class Transport {
 public:
  explicit Transport(TransportOptions options) : options_(std::move(options)) {}

  // Returns the answer, whatever its status. Throws NoAnswer, Error kCancelled when asked to stop,
  // Error kInternal for a body beyond what the API ever sends, and what source or sink throw.
  //
  // A server that answers before it has taken the whole body is heard: the rest is not sent.
  Answer send(const Exchange& exchange) const;

 private:
  TransportOptions options_;
};

}  // namespace isomesh
