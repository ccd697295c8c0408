// Checks JSON Web Tokens (RFC 7519, RFC 8725) of one provider.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "server/http/oidc/signing_keys.h"
#include "server/http/requests/request.h"

namespace isomesh::oidc {

// Whose tokens are accepted, and what they allow.
struct TokenRules {
  std::string issuer;
  std::string audience;
  // The member that lists the roles: its name, or names on the way to it, separated by dots.
  std::string role_claim;
  std::map<std::string, http::Role> roles;  // by their names there; `*` is a role of everybody
};

// A token's head, before its signature was checked.
struct TokenHead {
  std::string algorithm;
  std::string key_id;
};

struct Login {
  http::Caller caller;
  std::chrono::system_clock::time_point expires;  // with the skew of clocks
};

// True if the text has the shape of such a token: three parts.
bool is_web_token(std::string_view token);

// Errors kUnauthorized of the functions below say what is wrong, without any text of the token.

// Throws Error kUnauthorized if the head is invalid or asks for what is not supported.
TokenHead read_head(std::string_view token);

// Accepts the token if one of `keys`, all with the head's id, has signed it. The algorithm is the
// key's. Throws Error kUnauthorized, and kForbidden if the token has no role here.
Login check_token(std::string_view token, const TokenHead& head,
                  const std::vector<SigningKey>& keys, const TokenRules& rules,
                  std::chrono::system_clock::time_point now);

}  // namespace isomesh::oidc
