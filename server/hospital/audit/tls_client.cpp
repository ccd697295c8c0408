#include "server/hospital/audit/tls_client.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <thread>

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/sockios.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "proto/error.h"
#include "server/net/connect.h"

namespace isomesh::audit {
namespace {

[[noreturn]] void throw_lost() {
  ERR_clear_error();
  throw Error(ErrorCode::kUnreachable, "the connection to the collector was lost");
}

bool is_address(const std::string& host) {
  in6_addr address = {};
  return ::inet_pton(AF_INET, host.c_str(), &address) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

}  // namespace

struct TlsClient::Session {
  using Context = std::unique_ptr<SSL_CTX, decltype(&::SSL_CTX_free)>;
  using Ssl = std::unique_ptr<SSL, decltype(&::SSL_free)>;

  Session(const TlsServer& server, int socket)
      : context(SSL_CTX_new(TLS_client_method()), &::SSL_CTX_free), ssl(nullptr, &::SSL_free) {
    if (!context) throw Error(ErrorCode::kInternal, "TLS is not available");
    SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
    SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER, nullptr);
    SSL_CTX_set_mode(context.get(), SSL_MODE_AUTO_RETRY);
    SSL_CTX_set_session_cache_mode(context.get(),
                                   SSL_SESS_CACHE_CLIENT | SSL_SESS_CACHE_NO_INTERNAL);
    SSL_CTX_sess_set_new_cb(context.get(), &Session::note_ticket);
    load_files(server);
    ssl.reset(SSL_new(context.get()));
    SSL_set_ex_data(ssl.get(), 0, this);
    X509_VERIFY_PARAM* const parameters = SSL_get0_param(ssl.get());
    if (is_address(server.host)) {
      X509_VERIFY_PARAM_set1_ip_asc(parameters, server.host.c_str());
    } else {
      // As the macro SSL_set_tlsext_host_name, which has a C cast.
      std::string name = server.host;
      SSL_ctrl(ssl.get(), SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, name.data());
      X509_VERIFY_PARAM_set1_host(parameters, server.host.c_str(), server.host.size());
    }
    SSL_set_fd(ssl.get(), socket);
    if (SSL_connect(ssl.get()) == 1) {
      is_accepted = is_accepted || SSL_version(ssl.get()) < TLS1_3_VERSION;
      return;
    }
    const bool is_stranger = SSL_get_verify_result(ssl.get()) != X509_V_OK;
    ERR_clear_error();
    throw Error(ErrorCode::kUnreachable, is_stranger
                                             ? "the collector's certificate is not trusted"
                                             : "the TLS connection to the collector failed");
  }

  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  // Called by OpenSSL for each session ticket.
  static int note_ticket(SSL* ssl, SSL_SESSION*) {
    static_cast<Session*>(SSL_get_ex_data(ssl, 0))->is_accepted = true;
    return 0;  // OpenSSL keeps the ticket's ownership
  }

  void load_files(const TlsServer& server) const {
    const bool has_authorities =
        server.authorities.empty()
            ? SSL_CTX_set_default_verify_paths(context.get()) == 1
            : SSL_CTX_load_verify_file(context.get(), server.authorities.c_str()) == 1;
    const bool has_certificate =
        server.certificate.empty() ||
        (SSL_CTX_use_certificate_chain_file(context.get(), server.certificate.c_str()) == 1 &&
         SSL_CTX_use_PrivateKey_file(context.get(), server.key.c_str(), SSL_FILETYPE_PEM) == 1);
    ERR_clear_error();
    if (has_authorities && has_certificate) return;
    throw Error(ErrorCode::kInvalidParameter, "a certificate or key of [audit] cannot be read");
  }

  Context context;
  Ssl ssl;
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
