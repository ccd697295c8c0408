// The hospital's own login provider (OpenID Connect): its tokens are accepted as logins.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/http/oidc/signing_keys.h"
#include "server/http/oidc/web_token.h"

namespace isomesh::oidc {

struct ProviderTimes {
  std::chrono::milliseconds refresh = std::chrono::minutes(10);  // keys are read so often
  // Between two reads that tokens with an unknown key, or a failure, cause.
  std::chrono::milliseconds between_reads = std::chrono::seconds(10);
  // Keys of a provider that cannot be reached are used for so long.
  std::chrono::milliseconds oldest = std::chrono::hours(24);
};

struct ProviderOptions {
  std::string issuer;  // a URL; empty: there is no provider
  std::string audience;
  std::string client_id;                // of the page; empty: the page has no login
  std::vector<std::string> parameters;  // of the page's login, each NAME=VALUE
  std::string role_claim = "roles";
  // Each VALUE=ROLE. Empty: isomesh-user, isomesh-admin and isomesh-monitor.
  std::vector<std::string> roles;
  std::filesystem::path authorities;  // to trust instead of the system's
  ProviderTimes times = {};
};

// What a page needs to log a person in.
struct PageLogin {
  std::string issuer;
  std::string client_id;
  std::string authorization_endpoint;
  std::string token_endpoint;
  bool uses_id_token = false;  // the token of a login to send here; otherwise the access token
  std::vector<std::pair<std::string, std::string>> parameters;
};

// Throws Error kInvalidParameter for an option that is invalid. Asks no provider.
void check_options(const ProviderOptions& options);

// The roles of such options. Throws Error kInvalidParameter.
std::map<std::string, http::Role> roles_from(const std::vector<std::string>& texts);

// The parameters of such options. Throws Error kInvalidParameter for one that the page sets itself.
std::vector<std::pair<std::string, std::string>> login_parameters_from(
    const std::vector<std::string>& texts);

// Reads the provider's keys in a thread of its own, at once and again. Nothing waits for it: it may
// be away at the start, slow, or hostile. Thread safe.
class Provider {
 public:
  // Throws Error kInvalidParameter for an option that is invalid.
  explicit Provider(const ProviderOptions& options);
  ~Provider();
  Provider(const Provider&) = delete;
  Provider& operator=(const Provider&) = delete;

  // Who a token belongs to. Throws Error kUnauthorized if it is not accepted, kForbidden if it has
  // no role here, and kUnavailable if that cannot be told now: the keys were never read, or are
  // read again because the token has a new one.
  Login login_of(std::string_view token) const ISOMESH_EXCLUDES(mutex_);

  // Empty if the page has no login. Throws Error kUnavailable while the provider was never reached.
  std::optional<PageLogin> page_login() const ISOMESH_EXCLUDES(mutex_);

  // The origin that the page connects to for its login; empty if it has none.
  std::string page_origin() const ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;

  // What the provider says about itself.
  struct Description {
    std::string keys;  // a URL, as the others
    std::string authorization;
    std::string token;
  };
  struct Known {
    Description description;
    std::vector<SigningKey> keys;
  };

  void run(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);
  // Throws Error with the reason.
  Known read(const std::stop_token& stop) const;
  Description described(const std::string& json) const;
  std::string fetched(const std::string& url, const std::stop_token& stop) const;
  // Throws Error kUnavailable if keys that may have the id are being read, or cannot be.
  void ask_for_key() const ISOMESH_EXCLUDES(mutex_);

  const ProviderOptions options_;
  const TokenRules rules_;
  const std::vector<std::pair<std::string, std::string>> parameters_;
  mutable Mutex mutex_;
  mutable Condition changed_;
  std::shared_ptr<const Known> known_ ISOMESH_GUARDED_BY(mutex_);  // null: nothing was read yet
  Clock::time_point read_at_ ISOMESH_GUARDED_BY(mutex_);           // when that was begun
  Clock::time_point tried_at_ ISOMESH_GUARDED_BY(mutex_);          // when the last read was begun
  bool has_failed_ ISOMESH_GUARDED_BY(mutex_) = false;             // the last read
  mutable bool is_reading_ ISOMESH_GUARDED_BY(mutex_) = true;      // or will at once
  std::jthread thread_;                                            // last: uses the other members
};

}  // namespace isomesh::oidc
