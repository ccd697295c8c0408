#include "server/net/tls_stream.h"

#include <algorithm>
#include <climits>

#include <arpa/inet.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include "proto/error.h"

namespace isomesh::net {
namespace {

int length_of(std::size_t size) {
  return static_cast<int>(std::min(size, static_cast<std::size_t>(INT_MAX)));
}

bool is_ip_address(const std::string& host) {
  in6_addr address = {};
  return ::inet_pton(AF_INET, host.c_str(), &address) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

TlsFault fault_of_certificate(long result) {
  switch (result) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return TlsFault::kExpired;
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return TlsFault::kNotYetValid;
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:  // another authority of the same name
      return TlsFault::kUnknownAuthority;
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return TlsFault::kWrongName;
    default:
      return TlsFault::kInvalid;
  }
}

TlsFault fault_of_alert(int alert) {
  switch (alert) {
    case SSL_AD_HANDSHAKE_FAILURE:  // the answer of TLS 1.2 to a missing certificate
    case SSL_AD_BAD_CERTIFICATE:
    case SSL_AD_UNSUPPORTED_CERTIFICATE:
    case SSL_AD_CERTIFICATE_REVOKED:
    case SSL_AD_CERTIFICATE_EXPIRED:
    case SSL_AD_CERTIFICATE_UNKNOWN:
    case SSL_AD_UNKNOWN_CA:
    case SSL_AD_ACCESS_DENIED:
    case SSL_AD_CERTIFICATE_REQUIRED:
      return TlsFault::kRefused;
    case SSL_AD_PROTOCOL_VERSION:
    case SSL_AD_INSUFFICIENT_SECURITY:
      return TlsFault::kNoVersion;
    default:
      return TlsFault::kOther;
  }
}

}  // namespace

TlsFault tls_fault_of(const SSL* ssl) {
  const int reason = ERR_GET_REASON(ERR_peek_last_error());
  if (reason > SSL_AD_REASON_OFFSET) return fault_of_alert(reason - SSL_AD_REASON_OFFSET);
  switch (reason) {
    case SSL_R_CERTIFICATE_VERIFY_FAILED:
      return fault_of_certificate(SSL_get_verify_result(ssl));
    case SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE:
      return TlsFault::kMissing;
    case SSL_R_WRONG_VERSION_NUMBER:
    case SSL_R_HTTP_REQUEST:
    case SSL_R_HTTPS_PROXY_REQUEST:
    case SSL_R_BAD_RECORD_TYPE:
    case SSL_R_PACKET_LENGTH_TOO_LONG:
    case SSL_R_RECORD_LENGTH_MISMATCH:
      return TlsFault::kNotTls;
    case SSL_R_NO_SHARED_CIPHER:
    case SSL_R_UNSUPPORTED_PROTOCOL:
    case SSL_R_VERSION_TOO_LOW:
      return TlsFault::kNoVersion;
    default:
      return TlsFault::kOther;
  }
}

std::string text_of(TlsFault fault, std::string_view peer) {
  const std::string who(peer);
  const std::string certificate = "the certificate of " + who;
  switch (fault) {
    case TlsFault::kExpired:
      return certificate + " has expired: it must be renewed there";
    case TlsFault::kNotYetValid:
      return certificate + " is not valid yet: check the clocks of both machines";
    case TlsFault::kUnknownAuthority:
      return certificate + " is from an authority that is not trusted: add that to ca-file";
    case TlsFault::kWrongName:
      return certificate + " is for another name than the one by which it is configured";
    case TlsFault::kInvalid:
      return certificate + " is not trusted: check its purpose, key and chain";
    case TlsFault::kMissing:
      return who + " has no certificate, but needs one of the authorities in ca-file";
    case TlsFault::kRefused:
      return who +
             " refuses the certificate of isomeshd, or that it has none: check "
             "certificate-file, and which authorities are trusted there";
    case TlsFault::kNotTls:
      return who + " does not use TLS on this port: use TLS on both sides, or on none";
    case TlsFault::kNoVersion:
      return who +
             " accepts no version and cipher of TLS that isomeshd accepts: it must know "
             "TLS 1.2 with AES-GCM, or TLS 1.3";
    case TlsFault::kNone:
    case TlsFault::kOther:
      break;
  }
  return "TLS with " + who + " failed";
}

void expect_name(SSL* ssl, const std::string& name) {
  X509_VERIFY_PARAM* const parameters = SSL_get0_param(ssl);
  if (is_ip_address(name)) {
    X509_VERIFY_PARAM_set1_ip_asc(parameters, name.c_str());
    return;
  }
  // As the macro SSL_set_tlsext_host_name, which has a C cast.
  std::string asked = name;
  SSL_ctrl(ssl, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, asked.data());
  X509_VERIFY_PARAM_set1_host(parameters, name.c_str(), name.size());
}

TlsStream::TlsStream(SSL_CTX* context, int socket, Side side)
    : plain_(socket), ssl_(SSL_new(context), &SSL_free) {
  if (!ssl_ || SSL_set_fd(ssl_.get(), socket) != 1) {
    throw Error(ErrorCode::kInternal, "a TLS connection cannot be started");
  }
  if (side == Side::kServer) {
    SSL_set_accept_state(ssl_.get());
  } else {
    SSL_set_connect_state(ssl_.get());
  }
}

Transfer TlsStream::shake_hands() {
  ERR_clear_error();
  return outcome(SSL_do_handshake(ssl_.get()));
}

Transfer TlsStream::read(std::span<char> target) {
  ERR_clear_error();
  return outcome(SSL_read(ssl_.get(), target.data(), length_of(target.size())));
}

Transfer TlsStream::write(std::string_view bytes) {
  ERR_clear_error();
  return outcome(SSL_write(ssl_.get(), bytes.data(), length_of(bytes.size())));
}

// Nothing may be sent after an error, and before the handshake there is nothing to end.
void TlsStream::finish_writing() {
  ERR_clear_error();
  if (!broken_ && SSL_is_init_finished(ssl_.get()) == 1) SSL_shutdown(ssl_.get());
  plain_.finish_writing();
}

Transfer TlsStream::outcome(int result) {
  if (result > 0) return {Transfer::State::kDone, static_cast<std::size_t>(result)};
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return {Transfer::State::kWantsRead, 0};
    case SSL_ERROR_WANT_WRITE:
      return {Transfer::State::kWantsWrite, 0};
    case SSL_ERROR_SSL:
      if (ERR_GET_REASON(ERR_peek_last_error()) != SSL_R_UNEXPECTED_EOF_WHILE_READING) {
        fault_ = tls_fault_of(ssl_.get());
      }
      broken_ = true;
      return {Transfer::State::kClosed, 0};
    case SSL_ERROR_ZERO_RETURN:
      return {Transfer::State::kClosed, 0};
    default:
      broken_ = true;
      return {Transfer::State::kClosed, 0};
  }
}

}  // namespace isomesh::net
