#include "server/configured_files.h"

#include <cerrno>
#include <fstream>
#include <system_error>

#include "proto/error.h"
#include "server/store/postgresql/connection.h"

namespace isomesh {
namespace {

class Check {
 public:
  // `option` is what names the file; without a name it is not configured.
  void file(const std::string& option, const std::filesystem::path& name) {
    if (name.empty()) return;
    std::error_code absent;
    errno = std::filesystem::is_directory(name, absent) ? EISDIR : 0;
    if (errno == 0 && std::ifstream(name)) return;
    const std::string reason = errno == 0 ? "" : ": " + std::generic_category().message(errno);
    faults_.push_back({option, name.string() + " cannot be read" + reason});
  }

  void finish() {
    if (!faults_.empty()) throw invalid_parameters(std::move(faults_));
  }

 private:
  std::vector<FieldError> faults_;
};

}  // namespace

void check_configured_files(const Options& options, const ConfiguredFiles& others) {
  Check check;
  check.file("tls-cert", options.tls_certificate);
  check.file("tls-key", options.tls_key);
  check.file("tokens", options.tokens);
  check.file("callback-secret-file", options.callback_secrets);
  check.file("blob-credentials", options.blobs.credentials);
  check.file("callback-ca", options.callback_authorities);
  check.file("blob-ca", options.blobs.authorities);
  check.file("oidc-ca", options.provider.authorities);
  for (const auto& [name, file] : others) check.file(name, file);
  check.finish();
}

ConfiguredFiles files_of_store(const Options& options) {
  ConfiguredFiles files;
  if (options.store.empty()) return files;
  for (const auto& [keyword, file] : store::postgresql::files_of_url(options.store)) {
    files.emplace_back("store: " + keyword, file);
  }
  return files;
}

}  // namespace isomesh
