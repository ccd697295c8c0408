// OpenSSL's contexts, made of PEM files.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

using SSL_CTX = struct ssl_ctx_st;  // NOLINT: OpenSSL's name

namespace isomesh::net {

// A file, and the option or key of the configuration that names it.
struct TlsFile {
  std::string option;
  std::filesystem::path path;  // empty: none
};

struct TlsIdentity {
  TlsFile certificate;  // with its chain
  TlsFile key;
  TlsFile authorities;  // that sign the certificates of peers
};

using TlsContext = std::shared_ptr<SSL_CTX>;

// Both are for TLS 1.2 or later. Both throw Error kInvalidParameter with the option of a file that
// cannot be used.

// With authorities, peers must have certificates of them.
TlsContext tls_server_context(const TlsIdentity& identity);

// Without authorities, trusts the system's.
TlsContext tls_client_context(const TlsIdentity& identity);

}  // namespace isomesh::net
