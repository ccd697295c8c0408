// A connection to a server over TLS, for what is only sent.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "base/descriptor.h"

namespace isomesh::audit {

struct TlsServer {
  std::string host;
  std::uint16_t port = 0;
  std::filesystem::path authorities;  // PEM; empty: the system's
  std::filesystem::path certificate;  // ours; empty: none
  std::filesystem::path key;
};

// Not thread safe.
class TlsClient {
 public:
  // Connects, by TLS 1.2 or newer, to a server whose certificate is for its name. Everything may
  // take `timeout`. Throws Error kUnreachable, kRequestTimeout, kInvalidParameter for files that
  // cannot be read, and kCancelled when `stop` is requested.
  TlsClient(const TlsServer& server, std::chrono::seconds timeout, const std::stop_token& stop);
  ~TlsClient();
  TlsClient(const TlsClient&) = delete;
  TlsClient& operator=(const TlsClient&) = delete;

  // False when the server has ended the connection.
  bool is_open();

  // Throws Error kUnreachable.
  void send(std::string_view bytes);

  // Returns when the server's machine has all that was sent. Throws Error kUnreachable when it has
  // not within the timeout.
  void await_receipt();

 private:
  struct Session;

  const std::chrono::seconds timeout_;
  const std::stop_token stop_;
  Descriptor socket_;
  std::unique_ptr<Session> session_;
};

}  // namespace isomesh::audit
