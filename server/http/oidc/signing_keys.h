// The public keys that a provider signs its tokens with (RFC 7517, RFC 7518).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <openssl/types.h>

namespace isomesh::oidc {

// All are of public keys, over SHA-256. A key has one of them; what a token says about it must
// agree.
enum class Signing { kRs256, kPs256, kEs256 };

std::string_view to_string(Signing signing);

// A key with its id. Constant; copies share it. Thread safe.
class SigningKey {
 public:
  const std::string& id() const { return id_; }
  Signing signing() const { return signing_; }

  // `signature` as in a token: for ES256, two numbers of 32 bytes.
  bool has_signed(std::string_view text, std::string_view signature) const;

 private:
  friend std::vector<SigningKey> read_keys(std::string_view json);
  SigningKey(std::string id, Signing signing, std::shared_ptr<EVP_PKEY> key)
      : id_(std::move(id)), signing_(signing), key_(std::move(key)) {}

  std::string id_;
  Signing signing_;
  std::shared_ptr<EVP_PKEY> key_;
};

// Reads a JWK Set. Skips keys for other purposes and of other kinds: without an id, with an
// algorithm beside those above, RSA outside 2048 to 8192 bits, and curves beside P-256. A key that
// names no algorithm has RS256 or ES256. Throws Error kInvalidParameter if it is no JWK Set, has
// too many keys, or no usable one.
std::vector<SigningKey> read_keys(std::string_view json);

}  // namespace isomesh::oidc
