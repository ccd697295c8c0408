// A TLS connection to a server, for sending only.
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
  std::filesystem::path certificate;  // client certificate; empty: none
  std::filesystem::path key;
};

// Not thread safe.
class TlsClient {
 public:
  // Connects by TLS 1.2 or newer, and verifies that the certificate is for the server's name.
  // `timeout` limits each operation. Throws Error kUnreachable; kRequestTimeout; kInvalidParameter
  // if a file cannot be read; kCancelled if `stop` is requested.
  TlsClient(const TlsServer& server, std::chrono::seconds timeout, const std::stop_token& stop);
  ~TlsClient();
  TlsClient(const TlsClient&) = delete;
  TlsClient& operator=(const TlsClient&) = delete;

  // False once the server has closed the connection.
  bool is_open();

  // Throws Error kUnreachable.
  void send(std::string_view bytes);

  // Returns when the server's TCP has confirmed all sent bytes, and the server has accepted this
  // client's certificate: until then it may reject what it has confirmed. A server of TLS 1.3 that
  // sends no session ticket counts as accepting if the connection is open after the timeout. Throws
  // Error kUnreachable if the connection is lost, or if bytes are unconfirmed after the timeout.
  void await_receipt();

 private:
  struct Session;

  const std::chrono::seconds timeout_;
  const std::stop_token stop_;
  Descriptor socket_;
  std::unique_ptr<Session> session_;
};

}  // namespace isomesh::audit
