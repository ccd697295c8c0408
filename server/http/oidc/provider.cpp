#include "server/http/oidc/provider.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include <curl/curl.h>

#include "base/curl.h"
#include "base/curl_transfer.h"
#include "base/log.h"
#include "base/text.h"
#include "server/http/limits.h"
#include "server/http/oidc/provider_address.h"
#include "server/http/oidc/strict_json.h"

namespace isomesh::oidc {
namespace {

constexpr const char* kAway = "the login provider cannot be reached at the moment";

// A provider may answer anything; its texts are not repeated.
[[noreturn]] void fail(const std::string& reason) { throw Error(ErrorCode::kUnreachable, reason); }

std::pair<std::string, std::string> halves(const char* option, const std::string& text,
                                           std::size_t equals) {
  if (equals == std::string::npos || equals == 0) {
    throw invalid_parameter(option, '"' + text + "\" has no equals sign, or nothing before it");
  }
  return {text.substr(0, equals), text.substr(equals + 1)};
}

// The endpoint's URL from a provider's description. A provider elsewhere must not lead to programs
// of this machine.
std::string address_in(const Json& description, const char* name, bool is_plain) {
  std::string url = text_of(description, name);
  const std::string wrong = wrong_address(url, is_plain ? Plain::kOnLoopback : Plain::kNever);
  if (!wrong.empty()) fail("its description is invalid: " + std::string(name) + ' ' + wrong);
  return url;
}

}  // namespace

std::map<std::string, http::Role> roles_from(const std::vector<std::string>& texts) {
  if (texts.empty()) {
    return {{"isomesh-user", http::Role::kUser},
            {"isomesh-admin", http::Role::kAdmin},
            {"isomesh-monitor", http::Role::kMonitor}};
  }
  std::map<std::string, http::Role> roles;
  for (const std::string& text : texts) {
    const auto [value, name] = halves("oidc-role", text, text.rfind('='));
    const auto role = http::role_from(name);
    if (!role)
      throw invalid_parameter("oidc-role", '"' + name + "\" is not user, admin or monitor");
    if (!roles.emplace(value, *role).second) {
      throw invalid_parameter("oidc-role", '"' + value + "\" has two roles");
    }
  }
  return roles;
}

std::vector<std::pair<std::string, std::string>> login_parameters_from(
    const std::vector<std::string>& texts) {
  constexpr std::array<std::string_view, 12> kOwn = {
      "client_id",     "client_secret", "code",  "code_challenge", "code_challenge_method",
      "code_verifier", "grant_type",    "nonce", "redirect_uri",   "response_mode",
      "response_type", "state"};
  std::vector<std::pair<std::string, std::string>> parameters;
  for (const std::string& text : texts) {
    parameters.push_back(halves("oidc-parameter", text, text.find('=')));
    if (std::ranges::find(kOwn, parameters.back().first) != kOwn.end()) {
      throw invalid_parameter("oidc-parameter", parameters.back().first + " is set by the page");
    }
  }
  return parameters;
}

void check_options(const ProviderOptions& options) {
  const std::string wrong = wrong_issuer(options.issuer);
  if (!wrong.empty()) throw invalid_parameter("oidc-issuer", wrong);
  if (options.audience.empty()) {
    throw invalid_parameter(
        "oidc-audience",
        "is required with --oidc-issuer: otherwise tokens for any other program "
        "of the provider would be accepted");
  }
  if (options.role_claim.empty()) throw invalid_parameter("oidc-role-claim", "must not be empty");
  roles_from(options.roles);
  login_parameters_from(options.parameters);
}

Provider::Provider(const ProviderOptions& options)
    : options_((check_options(options), options)),
      rules_{.issuer = options.issuer,
             .audience = options.audience,
             .role_claim = options.role_claim,
             .roles = roles_from(options.roles)},
      parameters_(login_parameters_from(options.parameters)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

Provider::~Provider() {
  thread_.request_stop();
  thread_.join();
}

std::string Provider::fetched(const std::string& url, const std::stop_token& stop) const {
  const curl::Easy easy = curl::make_easy();
  curl_easy_setopt(easy.get(), CURLOPT_URL, url.c_str());
  curl::connect_directly(easy.get(), options_.authorities);
  const auto timeout = static_cast<long>(http::limits::kLongestProviderFetch.count());
  curl_easy_setopt(easy.get(), CURLOPT_TIMEOUT, timeout);
  curl_easy_setopt(easy.get(), CURLOPT_USERAGENT, "isomesh/" ISOMESH_VERSION);
  curl::Headers headers;
  curl::append(headers, "Accept: application/json");
  curl_easy_setopt(easy.get(), CURLOPT_HTTPHEADER, headers.get());
  std::string body;
  curl::TransferCallbacks callbacks;
  callbacks.sink = [&](std::span<const std::byte> bytes) {
    if (body.size() + bytes.size() > http::limits::kMostProviderBytes) {
      fail("its response is too large");
    }
    body.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return true;
  };
  const CURLcode result = curl::Transfer(easy.get(), std::move(callbacks), stop).perform();
  if (result != CURLE_OK) fail(curl_easy_strerror(result));
  long status = 0;
  curl_easy_getinfo(easy.get(), CURLINFO_RESPONSE_CODE, &status);
  constexpr long kOk = 200;
  if (status != kOk) fail("it responds with status " + std::to_string(status));
  return body;
}

Provider::Description Provider::described(const std::string& json) const {
  const JsonTree document = strict_object(json);
  if (text_of(document.root(), "issuer") != options_.issuer) {
    fail("its description names another issuer than --oidc-issuer");
  }
  const bool is_plain = is_plain_http(options_.issuer);
  Description description;
  description.keys = address_in(document.root(), "jwks_uri", is_plain);
  if (options_.client_id.empty()) return description;
  description.authorization = address_in(document.root(), "authorization_endpoint", is_plain);
  description.token = address_in(document.root(), "token_endpoint", is_plain);
  return description;
}

Provider::Known Provider::read(const std::stop_token& stop) const {
  const std::string base = options_.issuer.ends_with('/') ? options_.issuer : options_.issuer + '/';
  Known known;
  known.description = described(fetched(base + ".well-known/openid-configuration", stop));
  known.keys = read_keys(fetched(known.description.keys, stop));
  return known;
}

void Provider::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const Clock::time_point begun = Clock::now();
    std::shared_ptr<const Known> read_now;
    std::string reason;
    try {
      read_now = std::make_shared<const Known>(read(stop));
    } catch (const std::exception& error) {
      if (stop.stop_requested()) return;
      reason = error.what();
    }
    Lock lock(mutex_);
    const bool is_news = has_failed_ != !read_now || (!known_ && read_now);
    tried_at_ = begun;
    has_failed_ = !read_now;
    is_reading_ = false;
    if (read_now) {
      known_ = read_now;
      read_at_ = begun;
    }
    const auto pause = read_now ? options_.times.refresh : options_.times.between_reads;
    if (is_news) {
      lock.unlock();
      read_now ? log_info("the keys of the login provider were read")
               : log_error("the keys of the login provider cannot be read, which is retried: {}",
                           reason);
      lock.lock();
    }
    changed_.wait_for(lock, stop, pause, [this]() ISOMESH_REQUIRES(mutex_) { return is_reading_; });
    is_reading_ = true;
  }
}

void Provider::ask_for_key() const {
  const Lock lock(mutex_);
  if (!is_reading_ && !has_failed_ && Clock::now() - tried_at_ < options_.times.between_reads)
    return;
  if (!is_reading_ && !has_failed_) {
    is_reading_ = true;
    changed_.notify_all();
  }
  throw Error(ErrorCode::kUnavailable,
              has_failed_
                  ? std::string(kAway) + ", and the token has a key that was not known before"
                  : "the keys of the login provider are being read; send the token again");
}

Login Provider::login_of(std::string_view token) const {
  const TokenHead head = read_head(token);
  std::shared_ptr<const Known> known;
  {
    const Lock lock(mutex_);
    if (known_ && Clock::now() - read_at_ < options_.times.oldest) known = known_;
    if (!known && !has_failed_) {
      throw Error(ErrorCode::kUnavailable,
                  "the keys of the login provider are being read; send the token again");
    }
  }
  if (!known) {
    throw Error(ErrorCode::kUnavailable, std::string(kAway) + ", so its tokens cannot be checked");
  }
  const bool has_key =
      std::ranges::any_of(known->keys, [&](const auto& key) { return key.id() == head.key_id; });
  if (!has_key) ask_for_key();
  return check_token(token, head, known->keys, rules_, std::chrono::system_clock::now());
}

std::optional<PageLogin> Provider::page_login() const {
  if (options_.client_id.empty()) return std::nullopt;
  const Lock lock(mutex_);
  if (!known_) throw Error(ErrorCode::kUnavailable, std::string(kAway) + ", so nobody can log in");
  return PageLogin{.issuer = options_.issuer,
                   .client_id = options_.client_id,
                   .authorization_endpoint = known_->description.authorization,
                   .token_endpoint = known_->description.token,
                   .uses_id_token = options_.audience == options_.client_id,
                   .parameters = parameters_};
}

std::string Provider::page_origin() const {
  if (options_.client_id.empty()) return {};
  const Lock lock(mutex_);
  return page_origin_of(known_ ? known_->description.token : options_.issuer);
}

}  // namespace isomesh::oidc
