// Accepts TLS with the files of the configuration.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "base/descriptor.h"
#include "server/hospital/c_store/tls_relay.h"
#include "server/net/tls_context.h"

namespace isomesh::c_store {

// Not thread safe.
class TlsEntrance {
 public:
  // Throws Error kInvalidParameter if a file cannot be used.
  explicit TlsEntrance(net::TlsIdentity identity);

  // Rereads the files if they have changed. Files that cannot be used then are logged, and the
  // former ones used. Throws Error kInternal.
  std::unique_ptr<TlsRelay> accept(Descriptor peer);

 private:
  using Versions = std::array<std::string, 3>;  // differ if a file has changed

  Versions versions() const;

  const net::TlsIdentity identity_;
  Versions versions_;
  net::TlsContext context_;
};

}  // namespace isomesh::c_store
