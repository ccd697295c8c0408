// Connections encrypted with TLS 1.2 or later.
#pragma once

#include <filesystem>
#include <memory>

#include "base/mutex.h"
#include "proto/error.h"
#include "server/net/byte_stream.h"

using SSL_CTX = struct ssl_ctx_st;  // NOLINT: OpenSSL's name

namespace isomesh::net {

// A certificate (with the chain up to its authority) and its key, from two files in PEM form.
// Thread safe.
class TlsFiles {
 public:
  // Throws Error kInvalidParameter that names the option at fault.
  TlsFiles(std::filesystem::path certificate, std::filesystem::path key);

  // Reads the files again, for connections that come from now on. When that throws, everything
  // stays as it was.
  void reload();

  // The stream of an accepted socket; it shakes hands while it is read. Throws Error kInternal.
  std::unique_ptr<ByteStream> accept(int socket) const;

 private:
  using Context = std::shared_ptr<SSL_CTX>;

  Context read() const;

  const std::filesystem::path certificate_;
  const std::filesystem::path key_;
  mutable Mutex mutex_;
  Context context_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::net
