// Connections encrypted with TLS 1.2 or later.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/mutex.h"
#include "proto/error.h"
#include "server/net/byte_stream.h"
#include "server/net/tls_context.h"

namespace isomesh::net {

// Checks a file of trusted certificate authorities, which `option` names. Does nothing without a
// file. Throws Error kInvalidParameter.
void check_authorities(const std::string& option, const std::filesystem::path& file);

// A certificate (with its chain) and its key, from two PEM files. Thread safe.
class TlsFiles {
 public:
  // Throws Error kInvalidParameter with the invalid option's name.
  TlsFiles(std::filesystem::path certificate, std::filesystem::path key);

  // Rereads the files, for future connections. If that throws, nothing changes.
  void reload();

  // The stream of an accepted socket; the handshake happens during reads. Throws Error kInternal.
  std::unique_ptr<ByteStream> accept(int socket) const;

 private:
  TlsContext read() const;

  const std::filesystem::path certificate_;
  const std::filesystem::path key_;
  mutable Mutex mutex_;
  TlsContext context_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::net
