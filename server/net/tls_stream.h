// A socket encrypted with TLS.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "server/net/byte_stream.h"
#include "server/net/tls_context.h"

using SSL = struct ssl_st;  // NOLINT: OpenSSL's name

namespace isomesh::net {

// Why TLS does not connect. The first ones are about the certificate of the peer.
enum class TlsFault {
  kNone,
  kExpired,
  kNotYetValid,
  kUnknownAuthority,
  kWrongName,
  kInvalid,  // for another reason
  kMissing,
  kRefused,    // the peer refuses the certificate of this side, or that it has none
  kNotTls,     // the peer sends something else
  kNoVersion,  // the sides have no version or cipher in common
  kOther,
};

// A clause with the way out: "the certificate of the PACS has expired: ...".
std::string text_of(TlsFault fault, std::string_view peer);

// From the last error of OpenSSL in this thread.
TlsFault tls_fault_of(const SSL* ssl);

// Makes a client check that the certificate is for this name or address, and ask for it.
void expect_name(SSL* ssl, const std::string& name);

class TlsStream : public ByteStream {
 public:
  enum class Side { kServer, kClient };

  // Owns the socket even if this throws. Throws Error kInternal.
  TlsStream(SSL_CTX* context, int socket, Side side);

  int descriptor() const override { return plain_.descriptor(); }
  // kDone once the handshake is done, which read and write also do.
  Transfer shake_hands();
  Transfer read(std::span<char> target) override;
  Transfer write(std::string_view bytes) override;
  void finish_writing() override;

  SSL* ssl() const { return ssl_.get(); }
  // The reason for an end; kNone if the peer has just ended the connection.
  TlsFault fault() const { return fault_; }

 private:
  Transfer outcome(int result);

  PlainStream plain_;
  std::unique_ptr<SSL, void (*)(SSL*)> ssl_;
  bool broken_ = false;
  TlsFault fault_ = TlsFault::kNone;
};

}  // namespace isomesh::net
