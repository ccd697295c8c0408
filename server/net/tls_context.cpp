#include "server/net/tls_context.h"

#include <openssl/err.h>
#include <openssl/ssl.h>

#include "proto/error.h"

namespace isomesh::net {
namespace {

// For TLS 1.2: suites with forward secrecy and authenticated encryption; 1.3 has no others. DHE is
// in DICOM's profiles (PS3.15, B.9 and B.12); a server here needs parameters for it, and has none.
constexpr const char* kCiphers = "ECDHE+AESGCM:ECDHE+CHACHA20:DHE+AESGCM";

// Otherwise OpenSSL would ask for a key's passphrase on the terminal.
int no_passphrase(char* /*buffer*/, int /*size*/, int /*writing*/, void* /*nothing*/) { return 0; }

// From the last error of OpenSSL.
std::string why_no_certificate() {
  switch (ERR_GET_REASON(ERR_peek_last_error())) {
    case SSL_R_EE_KEY_TOO_SMALL:
    case SSL_R_CA_KEY_TOO_SMALL:
      return "the key of a certificate is too weak: RSA keys need at least 2048 bits";
    case SSL_R_CA_MD_TOO_WEAK:
      return "a certificate is signed with a digest that is too weak: use SHA-256";
    default:
      return "the file cannot be read, or contains no certificate in PEM form";
  }
}

TlsContext new_context(const SSL_METHOD* method) {
  ERR_clear_error();
  TlsContext context(SSL_CTX_new(method), &SSL_CTX_free);
  if (!context) throw Error(ErrorCode::kInternal, "TLS is not available");
  SSL_CTX* const raw = context.get();
  SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION);
  SSL_CTX_set_options(raw, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(raw, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                            SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_default_passwd_cb(raw, no_passphrase);
  if (SSL_CTX_set_cipher_list(raw, kCiphers) != 1) {
    throw Error(ErrorCode::kInternal, "TLS has none of the required ciphers");
  }
  return context;
}

void load_certificate(SSL_CTX* context, const TlsIdentity& identity) {
  if (SSL_CTX_use_certificate_chain_file(context, identity.certificate.path.c_str()) != 1) {
    throw invalid_parameter(identity.certificate.option, why_no_certificate());
  }
  if (SSL_CTX_use_PrivateKey_file(context, identity.key.path.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context) != 1) {
    throw invalid_parameter(identity.key.option, "must contain the key of the certificate of " +
                                                     identity.certificate.option +
                                                     " in PEM form, without a passphrase");
  }
}

void load_authorities(SSL_CTX* context, const TlsFile& authorities) {
  // A certificate of a peer, without its authority, is trusted as well.
  X509_STORE_set_flags(SSL_CTX_get_cert_store(context), X509_V_FLAG_PARTIAL_CHAIN);
  if (SSL_CTX_load_verify_file(context, authorities.path.c_str()) == 1) return;
  ERR_clear_error();
  throw invalid_parameter(authorities.option,
                          "the file cannot be read, or contains no certificate in PEM form");
}

}  // namespace

TlsContext tls_server_context(const TlsIdentity& identity) {
  TlsContext context = new_context(TLS_server_method());
  load_certificate(context.get(), identity);
  if (!identity.authorities.path.empty()) {
    load_authorities(context.get(), identity.authorities);
    SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
    // A resumed session would skip the verification, with other files perhaps.
    SSL_CTX_set_session_cache_mode(context.get(), SSL_SESS_CACHE_OFF);
    SSL_CTX_set_options(context.get(), SSL_OP_NO_TICKET);
    SSL_CTX_set_num_tickets(context.get(), 0);
  }
  return context;
}

TlsContext tls_client_context(const TlsIdentity& identity) {
  TlsContext context = new_context(TLS_client_method());
  SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER, nullptr);
  if (!identity.certificate.path.empty()) load_certificate(context.get(), identity);
  if (!identity.authorities.path.empty()) {
    load_authorities(context.get(), identity.authorities);
  } else if (SSL_CTX_set_default_verify_paths(context.get()) != 1) {
    throw Error(ErrorCode::kInternal, "the system's certificate authorities cannot be read");
  }
  return context;
}

}  // namespace isomesh::net
