#include "server/net/tls.h"

#include <utility>

#include <sys/stat.h>

#include "base/log.h"
#include "server/net/tls_stream.h"

namespace isomesh::net {
namespace {

void warn_if_readable(const std::filesystem::path& key) {
  struct stat status = {};
  if (::stat(key.c_str(), &status) == 0 && (status.st_mode & S_IROTH) != 0) {
    log_warning("every user of this machine can read the private key of the TLS certificate");
  }
}

}  // namespace

void check_authorities(const std::string& option, const std::filesystem::path& file) {
  if (file.empty()) return;
  tls_client_context(
      {.certificate = {}, .key = {}, .authorities = {.option = option, .path = file}});
}

TlsFiles::TlsFiles(std::filesystem::path certificate, std::filesystem::path key)
    : certificate_(std::move(certificate)), key_(std::move(key)), context_(read()) {
  warn_if_readable(key_);
}

void TlsFiles::reload() {
  TlsContext context = read();
  const Lock lock(mutex_);
  context_ = std::move(context);
}

std::unique_ptr<ByteStream> TlsFiles::accept(int socket) const {
  TlsContext context;
  {
    const Lock lock(mutex_);
    context = context_;
  }
  return std::make_unique<TlsStream>(context.get(), socket, TlsStream::Side::kServer);
}

TlsContext TlsFiles::read() const {
  return tls_server_context({.certificate = {.option = "tls-cert", .path = certificate_},
                             .key = {.option = "tls-key", .path = key_},
                             .authorities = {}});
}

}  // namespace isomesh::net
