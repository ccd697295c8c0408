#include "server/http/oidc/web_token.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/base64.h"
#include "base/text.h"
#include "server/http/limits.h"
#include "server/http/oidc/strict_json.h"

namespace isomesh::oidc {
namespace {

using std::chrono::system_clock;

// Subjects have this before them as owners, so that no provider can name an owner of --tokens.
constexpr std::string_view kOwnerPrefix = "oidc:";

[[noreturn]] void refuse(const std::string& reason) {
  throw Error(ErrorCode::kUnauthorized, "the token is not accepted: " + reason);
}

struct Parts {
  std::string_view head;
  std::string_view claims;
  std::string_view signature;
};

std::optional<Parts> parts_of(std::string_view token) {
  const std::size_t first = token.find('.');
  const std::size_t last = token.rfind('.');
  if (first == last || token.find('.', first + 1) != last) return std::nullopt;
  return Parts{.head = token.substr(0, first),
               .claims = token.substr(first + 1, last - first - 1),
               .signature = token.substr(last + 1)};
}

JsonTree decoded(std::string_view part, const std::string& name) {
  const auto text = from_base64url(part);
  if (!text) refuse("its " + name + " is not base64url");
  try {
    return strict_object(*text);
  } catch (const Error& error) {
    refuse("its " + name + ' ' + error.what());
  }
}

// Empty if there is none. Refuses what is no time.
std::optional<system_clock::time_point> time_in(const Json& claims, const char* name) {
  const Json* claim = json_values::find(claims, name);
  if (claim == nullptr) return std::nullopt;
  constexpr double kLatest = 253402300799;  // the end of the year 9999
  const double seconds = json_values::is_number(*claim) ? json_values::number(*claim) : -1;
  if (!(seconds >= 0 && seconds <= kLatest)) refuse('"' + std::string(name) + "\" is no time");
  // Later than the clock's last time is as good as that.
  constexpr double kLastSecond = 9'000'000'000;
  return system_clock::time_point(
      std::chrono::seconds(static_cast<std::int64_t>(std::min(seconds, kLastSecond))));
}

// The texts of a list, or the words of one text.
std::vector<std::string> texts_of(const Json& value) {
  std::vector<std::string> texts;
  if (json_values::is_string(value)) {
    const std::string text = json_values::text(value);
    for (const std::string_view word : words(text)) texts.emplace_back(word);
  } else if (json_values::is_array(value)) {
    for (std::size_t i = 0; i < json_values::array_size(value); ++i) {
      const Json& element = json_values::element(value, i);
      if (json_values::is_string(element)) texts.push_back(json_values::text(element));
    }
  }
  return texts;
}

void check_audience(const Json& claims, const std::string& audience) {
  const Json* claim = json_values::find(claims, "aud");
  if (claim == nullptr) refuse("it is for no audience");
  const bool is_ours = json_values::is_string(*claim)
                           ? json_values::text(*claim) == audience
                           : std::ranges::count(texts_of(*claim), audience) > 0;
  if (!is_ours) refuse("it is for another audience");
}

system_clock::time_point check_times(const Json& claims, system_clock::time_point now) {
  const auto expires = time_in(claims, "exp");
  if (!expires) refuse("it never expires");
  if (*expires + http::limits::kClockSkew <= now) refuse("it has expired");
  for (const char* name : {"nbf", "iat"}) {
    const auto begins = time_in(claims, name);
    if (begins && *begins > now + http::limits::kClockSkew) refuse("it is not valid yet");
  }
  return *expires + http::limits::kClockSkew;
}

std::string subject_of(const Json& claims) {
  const std::string subject = text_of(claims, "sub");
  const bool is_printable =
      std::ranges::all_of(subject, [](char c) { return c >= ' ' && c <= '~'; });
  if (subject.empty() || subject.size() > http::limits::kLongestSubject || !is_printable) {
    refuse("\"sub\" is not 1 to 255 characters of ASCII");
  }
  return subject;
}

const Json* find_claim(const Json& claims, const std::string& path) {
  if (const Json* whole = json_values::find(claims, path)) return whole;
  const std::size_t dot = path.find('.');
  if (dot == std::string::npos) return nullptr;
  const Json* outer = json_values::find(claims, path.substr(0, dot));
  return outer == nullptr ? nullptr : find_claim(*outer, path.substr(dot + 1));
}

// The role that allows most; empty if the token has none.
std::optional<http::Role> role_in(const Json& claims, const TokenRules& rules) {
  std::vector<std::string> names = {"*"};
  if (const Json* claim = find_claim(claims, rules.role_claim)) {
    for (std::string& name : texts_of(*claim)) {
      if (name != "*") names.push_back(std::move(name));
    }
  }
  for (const http::Role role : {http::Role::kAdmin, http::Role::kUser, http::Role::kMonitor}) {
    for (const std::string& name : names) {
      const auto found = rules.roles.find(name);
      if (found != rules.roles.end() && found->second == role) return role;
    }
  }
  return std::nullopt;
}

// Other types are of other purposes, such as a message about a logout. Access tokens and ID tokens
// have these, or none.
bool is_login_type(std::string type) {
  constexpr std::string_view kPrefix = "application/";
  type = lower(type);
  if (type.starts_with(kPrefix)) type.erase(0, kPrefix.size());
  return type == "jwt" || type == "at+jwt";
}

}  // namespace

bool is_web_token(std::string_view token) { return parts_of(token).has_value(); }

TokenHead read_head(std::string_view token) {
  const auto parts = parts_of(token);
  if (!parts) refuse("it is no JSON Web Token");
  const JsonTree document = decoded(parts->head, "header");
  const Json& head = document.root();
  for (const char* name : {"crit", "b64", "zip", "enc"}) {
    if (json_values::find(head, name) != nullptr)
      refuse("its header asks for what is not supported");
  }
  if (json_values::find(head, "typ") != nullptr && !is_login_type(text_of(head, "typ"))) {
    refuse("it is a token for another purpose");
  }
  TokenHead result{.algorithm = text_of(head, "alg"), .key_id = text_of(head, "kid")};
  if (result.algorithm.empty()) refuse("its header names no algorithm");
  if (result.key_id.empty()) refuse("its header names no key");
  return result;
}

Login check_token(std::string_view token, const TokenHead& head,
                  const std::vector<SigningKey>& keys, const TokenRules& rules,
                  system_clock::time_point now) {
  const auto parts = parts_of(token);
  const auto signature = parts ? from_base64url(parts->signature) : std::nullopt;
  if (!signature) refuse("its signature is not base64url");
  const std::string_view is_signed = token.substr(0, parts->head.size() + 1 + parts->claims.size());
  const bool is_valid = std::ranges::any_of(keys, [&](const SigningKey& key) {
    return key.id() == head.key_id && to_string(key.signing()) == head.algorithm &&
           key.has_signed(is_signed, *signature);
  });
  if (!is_valid) refuse("it was not signed by the login provider");
  const JsonTree document = decoded(parts->claims, "payload");
  const Json& claims = document.root();
  if (text_of(claims, "iss") != rules.issuer) refuse("it is of another issuer");
  check_audience(claims, rules.audience);
  Login login;
  login.expires = check_times(claims, now);
  login.caller.name = std::string(kOwnerPrefix) + subject_of(claims);
  const auto role = role_in(claims, rules);
  if (!role) {
    throw Error(
        ErrorCode::kForbidden,
        "the login provider gives you no role in this service: ask your administrator for one");
  }
  login.caller.role = *role;
  return login;
}

}  // namespace isomesh::oidc
