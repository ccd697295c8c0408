// A login provider (OpenID Connect) of a test: keys, tokens, and a server that publishes them.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include <openssl/types.h>

namespace isomesh::test {

std::string to_base64url(const std::string& bytes);

// A new pair of keys; `algorithm` is RS256, PS256 or ES256. Copies share it.
class KeyPair {
 public:
  explicit KeyPair(const std::string& algorithm, int bits = 2048);

  const std::string& algorithm() const { return algorithm_; }
  std::string sign(const std::string& text) const;
  // The public key as a member of a JWK Set; `more` are further members such as `"use": "sig"`.
  std::string jwk(const std::string& id, const std::string& more = {}) const;
  std::string public_pem() const;

 private:
  std::string algorithm_;
  std::shared_ptr<EVP_PKEY> key_;
};

// head.payload.signature
std::string signed_token(const KeyPair& key, const std::string& head, const std::string& payload);

// A head that names the key.
std::string head_of(const KeyPair& key, const std::string& id);

// Claims of a person that any of the tests' rules accepts; `more` are further members.
std::string claims_of(const std::string& issuer, const std::string& subject,
                      const std::string& more = R"("roles": ["isomesh-user"])");

std::int64_t unix_time();

// Listens on a free port of loopback during its lifetime. Thread safe.
class LoginProvider {
 public:
  LoginProvider();
  ~LoginProvider();
  LoginProvider(const LoginProvider&) = delete;
  LoginProvider& operator=(const LoginProvider&) = delete;

  const std::string& issuer() const;
  // Publishes these members of a JWK Set from now on.
  void publish(const std::string& keys);
  // Responds with this status and text instead of what it publishes; 0 ends that.
  void break_with(int status, const std::string& text = {});
  // Replaces a member of its description.
  void describe(const std::string& name, const std::string& value);
  // Requests for keys so far.
  int reads() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::test
