#include "server/hospital/audit/tls_client.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <thread>

#include <fcntl.h>
#include <linux/sockios.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "proto/error.h"
#include "server/net/connect.h"
#include "server/net/tls_stream.h"

namespace isomesh::audit {
namespace {

[[noreturn]] void throw_lost() {
  ERR_clear_error();
  throw Error(ErrorCode::kUnreachable, "the connection to the collector was lost");
}

}  // namespace

struct TlsClient::Session {
  Session(const TlsServer& server, int socket)
      : context(net::tls_client_context(
            {.certificate = {.option = "audit.certificate-file", .path = server.certificate},
             .key = {.option = "audit.key-file", .path = server.key},
             .authorities = {.option = "audit.ca-file", .path = server.authorities}})),
        ssl(SSL_new(context.get()), &::SSL_free) {
    SSL_CTX_set_session_cache_mode(context.get(),
                                   SSL_SESS_CACHE_CLIENT | SSL_SESS_CACHE_NO_INTERNAL);
    SSL_CTX_sess_set_new_cb(context.get(), &Session::note_ticket);
    SSL_set_ex_data(ssl.get(), 0, this);
    net::expect_name(ssl.get(), server.host);
    SSL_set_fd(ssl.get(), socket);
    ERR_clear_error();
    if (SSL_connect(ssl.get()) == 1) {
      is_accepted = is_accepted || SSL_version(ssl.get()) < TLS1_3_VERSION;
      return;
    }
    const net::TlsFault fault = net::tls_fault_of(ssl.get());
    ERR_clear_error();
    throw Error(ErrorCode::kUnreachable, net::text_of(fault, "the collector"));
  }

  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  // Called by OpenSSL for each session ticket.
  static int note_ticket(SSL* ssl, SSL_SESSION*) {
    static_cast<Session*>(SSL_get_ex_data(ssl, 0))->is_accepted = true;
    return 0;  // OpenSSL keeps the ticket's ownership
  }

  net::TlsContext context;
  std::unique_ptr<SSL, decltype(&::SSL_free)> ssl;
  // The server has verified the client. A handshake of TLS 1.2 ends after that. One of TLS 1.3 ends
  // before it; the first session ticket comes after it.
  bool is_accepted = false;
};

TlsClient::TlsClient(const TlsServer& server, std::chrono::seconds timeout,
                     const std::stop_token& stop)
    : timeout_(timeout),
      stop_(stop),
      socket_(net::connect_to(server.host, server.port, timeout, stop)) {
  const timeval time = {timeout.count(), 0};
  ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
  ::setsockopt(socket_.number(), SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);
  const std::stop_callback cut(stop_, [this] { ::shutdown(socket_.number(), SHUT_RDWR); });
  session_ = std::make_unique<Session>(server, socket_.number());
}

TlsClient::~TlsClient() {
  if (session_) SSL_shutdown(session_->ssl.get());
  ERR_clear_error();
}

bool TlsClient::is_open() {
  // The server sends only TLS records such as tickets. They are read without waiting for more.
  ::fcntl(socket_.number(), F_SETFL, O_NONBLOCK);
  char byte = 0;
  const int count = SSL_read(session_->ssl.get(), &byte, 1);
  const int error = SSL_get_error(session_->ssl.get(), count);
  ERR_clear_error();
  ::fcntl(socket_.number(), F_SETFL, 0);
  return count > 0 || error == SSL_ERROR_WANT_READ;
}

void TlsClient::send(std::string_view bytes) {
  const std::stop_callback cut(stop_, [this] { ::shutdown(socket_.number(), SHUT_RDWR); });
  while (!bytes.empty()) {
    const auto piece = static_cast<int>(std::min<std::size_t>(bytes.size(), INT_MAX));
    const int count = SSL_write(session_->ssl.get(), bytes.data(), piece);
    if (count <= 0) throw_lost();
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
}

void TlsClient::await_receipt() {
  constexpr std::chrono::milliseconds kLookForReceipt{5};
  const auto deadline = std::chrono::steady_clock::now() + timeout_;
  const auto is_late = [&] { return std::chrono::steady_clock::now() >= deadline; };
  int unsent = 1;
  while (::ioctl(socket_.number(), SIOCOUTQ, &unsent) == 0 && unsent > 0) {
    if (is_late() || stop_.stop_requested()) throw_lost();
    std::this_thread::sleep_for(kLookForReceipt);
  }
  // A reset connection has no unsent bytes either.
  if (unsent != 0) throw_lost();
  while (is_open()) {
    // A server that sends no tickets has had enough time to reject the client.
    if (session_->is_accepted || is_late()) {
      session_->is_accepted = true;
      return;
    }
    if (stop_.stop_requested()) break;
    std::this_thread::sleep_for(kLookForReceipt);
  }
  throw_lost();
}

}  // namespace isomesh::audit
