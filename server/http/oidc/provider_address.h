// The addresses of a login provider.
#pragma once

#include <string>

namespace isomesh::oidc {

enum class Plain {
  kNever,
  kOnLoopback,  // http, to this machine only
};

// Why that URL is no address of a provider: it must be https, without a login and a fragment. Empty
// if it is one.
std::string wrong_address(const std::string& url, Plain plain);

// The same for an issuer, which has no query and may be http on loopback.
std::string wrong_issuer(const std::string& url);

// True for an http URL.
bool is_plain_http(const std::string& url);

// As pages and content policies name it: https://login.example or https://login.example:8443.
std::string page_origin_of(const std::string& url);

}  // namespace isomesh::oidc
