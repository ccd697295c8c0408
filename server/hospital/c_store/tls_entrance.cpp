#include "server/hospital/c_store/tls_entrance.h"

#include <utility>

#include <sys/stat.h>

#include "base/error.h"
#include "base/log.h"

namespace isomesh::c_store {
namespace {

std::string version_of(const net::TlsFile& file) {
  struct stat status = {};
  if (::stat(file.path.c_str(), &status) != 0) return "";
  std::string version;
  for (const auto number :
       {static_cast<std::int64_t>(status.st_ino), static_cast<std::int64_t>(status.st_size),
        status.st_mtim.tv_sec, status.st_mtim.tv_nsec}) {
    version += std::to_string(number) + ' ';
  }
  return version;
}

}  // namespace

// The versions are from before the files are read, so a change meanwhile is not missed.
TlsEntrance::TlsEntrance(net::TlsIdentity identity)
    : identity_(std::move(identity)),
      versions_(versions()),
      context_(net::tls_server_context(identity_)) {}

std::unique_ptr<TlsRelay> TlsEntrance::accept(Descriptor peer) {
  if (Versions now = versions(); now != versions_) {
    versions_ = std::move(now);
    try {
      context_ = net::tls_server_context(identity_);
      log_info("the changed certificate files of [dimse] are used");
    } catch (const Error& error) {
      log_error("the changed certificate files of [dimse] are not used: {}", error.what());
    }
  }
  return std::make_unique<TlsRelay>(std::make_unique<net::TlsStream>(
      context_.get(), peer.release(), net::TlsStream::Side::kServer));
}

TlsEntrance::Versions TlsEntrance::versions() const {
  return {version_of(identity_.certificate), version_of(identity_.key),
          version_of(identity_.authorities)};
}

}  // namespace isomesh::c_store
