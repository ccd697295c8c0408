#pragma once

#include <array>
#include <string>

#include <openssl/evp.h>

namespace isomesh::test {

// The SHA-256 of the bytes as the value of a digest header (RFC 9530).
inline std::string digest_of(const std::string& bytes) {
  std::array<unsigned char, 32> digest = {};
  unsigned size = digest.size();
  EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::array<unsigned char, 48> base64 = {};
  EVP_EncodeBlock(base64.data(), digest.data(), static_cast<int>(digest.size()));
  return "sha-256=:" + std::string(reinterpret_cast<const char*>(base64.data())) + ":";
}

}  // namespace isomesh::test
