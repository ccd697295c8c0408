#include "server/http/oidc/signing_keys.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/ec.h>
#include <openssl/ecdsa.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/param_build.h>
#include <openssl/rsa.h>

#include "base/base64.h"
#include "proto/error.h"
#include "server/http/limits.h"
#include "server/http/oidc/strict_json.h"

namespace isomesh::oidc {
namespace {

template <auto Free>
struct Freed {
  template <class T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Number = std::unique_ptr<BIGNUM, Freed<BN_free>>;
using Context = std::unique_ptr<EVP_PKEY_CTX, Freed<EVP_PKEY_CTX_free>>;
using Digest = std::unique_ptr<EVP_MD_CTX, Freed<EVP_MD_CTX_free>>;
using Builder = std::unique_ptr<OSSL_PARAM_BLD, Freed<OSSL_PARAM_BLD_free>>;
using Parameters = std::unique_ptr<OSSL_PARAM, Freed<OSSL_PARAM_free>>;
using Signature = std::unique_ptr<ECDSA_SIG, Freed<ECDSA_SIG_free>>;
using PublicKey = std::shared_ptr<EVP_PKEY>;

constexpr int kFewestRsaBits = 2048;
constexpr int kMostRsaBits = 8192;  // more would take long to check
constexpr int kMostExponentBits = 32;
constexpr std::size_t kCurveBytes = 32;

const unsigned char* data_of(std::string_view bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

Number number_of(std::string_view bytes) {
  return Number(BN_bin2bn(data_of(bytes), static_cast<int>(bytes.size()), nullptr));
}

PublicKey key_from(const char* kind, OSSL_PARAM_BLD* builder) {
  const Parameters parameters(OSSL_PARAM_BLD_to_param(builder));
  const Context context(EVP_PKEY_CTX_new_from_name(nullptr, kind, nullptr));
  EVP_PKEY* key = nullptr;
  const bool is_made =
      parameters && context && EVP_PKEY_fromdata_init(context.get()) == 1 &&
      EVP_PKEY_fromdata(context.get(), &key, EVP_PKEY_PUBLIC_KEY, parameters.get()) == 1;
  PublicKey made(key, EVP_PKEY_free);
  return is_made ? made : nullptr;
}

// Null if it is none that is accepted.
PublicKey rsa_key(const Json& jwk) {
  const auto modulus = from_base64url(text_of(jwk, "n"));
  const auto exponent = from_base64url(text_of(jwk, "e"));
  if (!modulus || !exponent || modulus->size() > kMostRsaBits / 8 + 1) return nullptr;
  const Number n = number_of(*modulus);
  const Number e = number_of(*exponent);
  if (!n || !e || BN_num_bits(n.get()) < kFewestRsaBits || BN_num_bits(n.get()) > kMostRsaBits ||
      BN_num_bits(e.get()) > kMostExponentBits || !BN_is_odd(e.get()) || BN_is_one(e.get())) {
    return nullptr;
  }
  const Builder builder(OSSL_PARAM_BLD_new());
  const bool is_set = builder &&
                      OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_N, n.get()) == 1 &&
                      OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_E, e.get()) == 1;
  return is_set ? key_from("RSA", builder.get()) : nullptr;
}

// Null if it is none that is accepted, such as a point beside the curve.
PublicKey curve_key(const Json& jwk) {
  const auto x = from_base64url(text_of(jwk, "x"));
  const auto y = from_base64url(text_of(jwk, "y"));
  if (text_of(jwk, "crv") != "P-256" || !x || !y || x->size() != kCurveBytes ||
      y->size() != kCurveBytes) {
    return nullptr;
  }
  constexpr char kUncompressed = 4;
  const std::string point = kUncompressed + *x + *y;
  const Builder builder(OSSL_PARAM_BLD_new());
  const bool is_set = builder &&
                      OSSL_PARAM_BLD_push_utf8_string(builder.get(), OSSL_PKEY_PARAM_GROUP_NAME,
                                                      "prime256v1", 0) == 1 &&
                      OSSL_PARAM_BLD_push_octet_string(builder.get(), OSSL_PKEY_PARAM_PUB_KEY,
                                                       point.data(), point.size()) == 1;
  return is_set ? key_from("EC", builder.get()) : nullptr;
}

std::optional<Signing> signing_of(const Json& jwk) {
  const std::string kind = text_of(jwk, "kty");
  if (kind != "RSA" && kind != "EC") return std::nullopt;
  const Signing usual = kind == "RSA" ? Signing::kRs256 : Signing::kEs256;
  const Json* name = json_values::find(jwk, "alg");
  if (name == nullptr) return usual;
  for (const Signing signing : {usual, kind == "RSA" ? Signing::kPs256 : usual}) {
    if (json_values::is_string(*name) && json_values::text(*name) == to_string(signing))
      return signing;
  }
  return std::nullopt;
}

bool is_for_signatures(const Json& jwk) {
  if (json_values::find(jwk, "use") != nullptr && text_of(jwk, "use") != "sig") return false;
  const Json* uses = json_values::find(jwk, "key_ops");
  if (uses == nullptr) return true;
  if (!json_values::is_array(*uses)) return false;
  for (std::size_t i = 0; i < json_values::array_size(*uses); ++i) {
    const Json& use = json_values::element(*uses, i);
    if (json_values::is_string(use) && json_values::text(use) == "verify") return true;
  }
  return false;
}

// OpenSSL's form of a signature by a curve; empty if it is none.
std::string as_der(std::string_view signature) {
  if (signature.size() != 2 * kCurveBytes) return {};
  Number r = number_of(signature.substr(0, kCurveBytes));
  Number s = number_of(signature.substr(kCurveBytes));
  const Signature pair(ECDSA_SIG_new());
  if (!r || !s || !pair || ECDSA_SIG_set0(pair.get(), r.get(), s.get()) != 1) return {};
  static_cast<void>(r.release());  // the pair owns them now
  static_cast<void>(s.release());
  unsigned char* bytes = nullptr;
  const int size = i2d_ECDSA_SIG(pair.get(), &bytes);
  if (size <= 0) return {};
  std::string der(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(size));
  OPENSSL_free(bytes);
  return der;
}

}  // namespace

std::string_view to_string(Signing signing) {
  switch (signing) {
    case Signing::kRs256:
      return "RS256";
    case Signing::kPs256:
      return "PS256";
    case Signing::kEs256:
      return "ES256";
  }
  return {};
}

bool SigningKey::has_signed(std::string_view text, std::string_view signature) const {
  const std::string der = signing_ == Signing::kEs256 ? as_der(signature) : std::string(signature);
  const Digest digest(EVP_MD_CTX_new());
  EVP_PKEY_CTX* context = nullptr;  // belongs to the digest
  bool is_set = digest && EVP_DigestVerifyInit(digest.get(), &context, EVP_sha256(), nullptr,
                                               key_.get()) == 1;
  if (signing_ == Signing::kPs256) {
    is_set = is_set && EVP_PKEY_CTX_set_rsa_padding(context, RSA_PKCS1_PSS_PADDING) == 1 &&
             EVP_PKEY_CTX_set_rsa_pss_saltlen(context, RSA_PSS_SALTLEN_DIGEST) == 1;
  }
  const bool is_valid = is_set && EVP_DigestVerify(digest.get(), data_of(der), der.size(),
                                                   data_of(text), text.size()) == 1;
  ERR_clear_error();  // otherwise the next TLS connection of this thread would report it
  return is_valid;
}

std::vector<SigningKey> read_keys(std::string_view json) {
  const JsonTree document = strict_object(json);
  const Json* list = json_values::find(document.root(), "keys");
  if (list == nullptr || !json_values::is_array(*list)) {
    throw Error(ErrorCode::kInvalidParameter, "has no list of keys");
  }
  if (json_values::array_size(*list) > http::limits::kMostSigningKeys) {
    throw Error(ErrorCode::kInvalidParameter, "has too many keys");
  }
  std::vector<SigningKey> keys;
  for (std::size_t i = 0; i < json_values::array_size(*list); ++i) {
    const Json& jwk = json_values::element(*list, i);
    const std::string id = text_of(jwk, "kid");
    const auto signing = signing_of(jwk);
    if (id.empty() || !signing || !is_for_signatures(jwk)) continue;
    PublicKey key = signing == Signing::kEs256 ? curve_key(jwk) : rsa_key(jwk);
    if (key) keys.push_back(SigningKey(id, *signing, std::move(key)));
  }
  ERR_clear_error();
  if (keys.empty())
    throw Error(ErrorCode::kInvalidParameter, "has no key of RS256, PS256 or ES256");
  return keys;
}

}  // namespace isomesh::oidc
