#include "base/sha256.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "base/error.h"
#include "base/hex.h"

namespace isomesh {
namespace {

void require(bool done) {
  if (!done) throw Error(ErrorCode::kInternal, "SHA-256 cannot be computed on this machine");
}

}  // namespace

struct Sha256::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~State() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  require(state_->context != nullptr &&
          EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) == 1);
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(std::span<const std::byte> bytes) {
  require(EVP_DigestUpdate(state_->context, bytes.data(), bytes.size()) == 1);
}

Sha256::Digest Sha256::finish() {
  Digest digest = {};
  require(EVP_DigestFinal_ex(state_->context, digest.data(), nullptr) == 1);
  return digest;
}

std::string sha256_of(std::string_view text) {
  Sha256 digest;
  digest.update(text);
  return to_hex(digest.finish());
}

std::string hmac_sha256(std::string_view key, std::string_view text) {
  std::array<unsigned char, Sha256::kBytes> mac = {};
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
           reinterpret_cast<const unsigned char*>(text.data()), text.size(), mac.data(),
           nullptr) == nullptr) {
    throw Error(ErrorCode::kInternal, "HMAC failed");
  }
  return {reinterpret_cast<const char*>(mac.data()), mac.size()};
}

}  // namespace isomesh
