#include "server/net/tls.h"

#include <algorithm>
#include <climits>
#include <utility>

#include <fcntl.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"

namespace isomesh::net {
namespace {

// For TLS 1.2: suites with forward secrecy and authenticated encryption; 1.3 has no others.
constexpr const char* kCiphers = "ECDHE+AESGCM:ECDHE+CHACHA20";

class TlsStream : public ByteStream {
 public:
  // Owns the socket even if this throws.
  TlsStream(SSL_CTX* context, int socket) : plain_(socket), ssl_(SSL_new(context), &SSL_free) {
    if (!ssl_ || SSL_set_fd(ssl_.get(), socket) != 1) {
      throw Error(ErrorCode::kInternal, "a TLS connection cannot be started");
    }
    SSL_set_accept_state(ssl_.get());
  }

  int descriptor() const override { return plain_.descriptor(); }

  Transfer read(std::span<char> target) override {
    ERR_clear_error();
    return outcome(SSL_read(ssl_.get(), target.data(), length_of(target.size())));
  }

  Transfer write(std::string_view bytes) override {
    ERR_clear_error();
    return outcome(SSL_write(ssl_.get(), bytes.data(), length_of(bytes.size())));
  }

  // Nothing may be sent after an error, and before the handshake there is nothing to end.
  void finish_writing() override {
    ERR_clear_error();
    if (!broken_ && SSL_is_init_finished(ssl_.get()) == 1) SSL_shutdown(ssl_.get());
    plain_.finish_writing();
  }

 private:
  static int length_of(std::size_t size) {
    return static_cast<int>(std::min(size, static_cast<std::size_t>(INT_MAX)));
  }

  Transfer outcome(int result) {
    if (result > 0) return {Transfer::State::kDone, static_cast<std::size_t>(result)};
    switch (SSL_get_error(ssl_.get(), result)) {
      case SSL_ERROR_WANT_READ:
        return {Transfer::State::kWantsRead, 0};
      case SSL_ERROR_WANT_WRITE:
        return {Transfer::State::kWantsWrite, 0};
      case SSL_ERROR_ZERO_RETURN:
        return {Transfer::State::kClosed, 0};
      default:
        broken_ = true;
        return {Transfer::State::kClosed, 0};
    }
  }

  PlainStream plain_;
  std::unique_ptr<SSL, decltype(&SSL_free)> ssl_;
  bool broken_ = false;
};

// Otherwise OpenSSL would ask for a key's passphrase on the terminal.
int no_passphrase(char* /*buffer*/, int /*size*/, int /*writing*/, void* /*nothing*/) { return 0; }

void warn_if_readable(const std::filesystem::path& key) {
  struct stat status = {};
  if (::stat(key.c_str(), &status) == 0 && (status.st_mode & S_IROTH) != 0) {
    log_warning("every user of this machine can read the private key of the TLS certificate");
  }
}

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

}  // namespace

void check_authorities(const std::string& option, const std::filesystem::path& file) {
  if (file.empty()) return;
  const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context(SSL_CTX_new(TLS_client_method()),
                                                                  &SSL_CTX_free);
  if (!context) throw Error(ErrorCode::kInternal, "TLS is not available");
  const bool is_read = SSL_CTX_load_verify_file(context.get(), file.c_str()) == 1;
  ERR_clear_error();
  if (is_read) return;
  throw invalid_parameter(option,
                          "the file cannot be read, or contains no certificate in PEM form");
}

TlsFiles::TlsFiles(std::filesystem::path certificate, std::filesystem::path key)
    : certificate_(std::move(certificate)), key_(std::move(key)), context_(read()) {
  warn_if_readable(key_);
}

void TlsFiles::reload() {
  Context context = read();
  const Lock lock(mutex_);
  context_ = std::move(context);
}

std::unique_ptr<ByteStream> TlsFiles::accept(int socket) const {
  Context context;
  {
    const Lock lock(mutex_);
    context = context_;
  }
  return std::make_unique<TlsStream>(context.get(), socket);
}

TlsFiles::Context TlsFiles::read() const {
  ERR_clear_error();
  Context context(SSL_CTX_new(TLS_server_method()), &SSL_CTX_free);
  if (!context) throw Error(ErrorCode::kInternal, "TLS is not available");
  SSL_CTX* raw = context.get();
  SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION);
  SSL_CTX_set_options(raw, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(raw, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                            SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_default_passwd_cb(raw, no_passphrase);
  if (SSL_CTX_set_cipher_list(raw, kCiphers) != 1) {
    throw Error(ErrorCode::kInternal, "TLS has none of the required ciphers");
  }
  if (SSL_CTX_use_certificate_chain_file(raw, certificate_.c_str()) != 1) {
    throw invalid_parameter("tls-cert", why_no_certificate());
  }
  if (SSL_CTX_use_PrivateKey_file(raw, key_.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(raw) != 1) {
    throw invalid_parameter(
        "tls-key",
        "must contain the key of the certificate of --tls-cert in PEM form, without a passphrase");
  }
  return context;
}

}  // namespace isomesh::net
