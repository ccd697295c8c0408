#include "server/http/oidc/signing_keys.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/login_provider.h"

namespace isomesh::oidc {
namespace {

using test::KeyPair;

std::vector<SigningKey> keys_of(const std::string& members) {
  return read_keys(R"({"keys": [)" + members + "]}");
}

// How many of them are used beside a good one.
std::size_t used_beside(const std::string& jwk) {
  static const std::string good = KeyPair("ES256").jwk("good");
  return keys_of(good + ", " + jwk).size() - 1;
}

TEST(SigningKeys, SayHowTheySign) {
  const KeyPair rsa("RS256");
  EXPECT_EQ(keys_of(rsa.jwk("a")).front().signing(), Signing::kRs256);
  EXPECT_EQ(keys_of(rsa.jwk("a", R"("alg": "RS256", "use": "sig")")).front().signing(),
            Signing::kRs256);
  EXPECT_EQ(keys_of(rsa.jwk("a", R"("alg": "PS256", "key_ops": ["verify"])")).front().signing(),
            Signing::kPs256);
  for (const char* more : {R"("alg": "HS256")", R"("alg": "RS512")", R"("alg": "ES256")",
                           R"("alg": "none")", R"("alg": null)", R"("use": "enc")", R"("use": 1)",
                           R"("key_ops": ["sign"])", R"("key_ops": "verify")"}) {
    EXPECT_EQ(used_beside(rsa.jwk("a", more)), 0U) << more;
  }
}

TEST(SigningKeys, OthersAreSkipped) {
  EXPECT_EQ(used_beside(KeyPair("ES256").jwk("")), 0U) << "without an id";
  EXPECT_EQ(used_beside(KeyPair("RS256", 1024).jwk("weak")), 0U);
  EXPECT_EQ(used_beside(R"({"kty": "oct", "kid": "a", "alg": "HS256", "k": "AAAA"})"), 0U);
  EXPECT_EQ(used_beside(R"({"kty": "OKP", "kid": "a", "crv": "Ed25519", "x": "AAAA"})"), 0U);
  EXPECT_EQ(used_beside(R"("text", 1, null, [], {})"), 0U);
  const std::string zeros(43, 'A');
  EXPECT_EQ(used_beside(R"({"kty": "EC", "kid": "a", "crv": "P-256", "x": ")" + zeros +
                        R"(", "y": ")" + zeros + "\"}"),
            0U)
      << "not on the curve";
  EXPECT_EQ(used_beside(R"({"kty": "EC", "kid": "a", "crv": "P-256", "x": "AAAA", "y": "AAAA"})"),
            0U);
  // An exponent that makes each check slow, one that makes it void, and one that is even.
  const std::string modulus = test::to_base64url(std::string(256, '\xff'));
  for (const std::string& exponent :
       {std::string(256, '\x7f'), std::string(1, '\x01'), std::string(1, '\x02'), std::string()}) {
    EXPECT_EQ(used_beside(R"({"kty": "RSA", "kid": "a", "n": ")" + modulus + R"(", "e": ")" +
                          test::to_base64url(exponent) + "\"}"),
              0U);
  }
  const std::string huge = test::to_base64url(std::string(4096, '\xff'));
  EXPECT_EQ(used_beside(R"({"kty": "RSA", "kid": "a", "n": ")" + huge + R"(", "e": "AQAB"})"), 0U);
}

TEST(SigningKeys, ASetWithoutAnyIsRefused) {
  std::string many = R"({"kid": "a"})";
  for (int i = 0; i < 100; ++i) many += R"(, {"kid": "a"})";
  for (const std::string& set :
       {std::string(), std::string("[]"), std::string("{}"), std::string(R"({"keys": {}})"),
        std::string(R"({"keys": []})"), R"({"keys": [)" + many + "]}"}) {
    EXPECT_EQ(test::code_thrown_by([&] { read_keys(set); }), ErrorCode::kInvalidParameter) << set;
  }
}

TEST(SigningKeys, CheckTheWholeSignature) {
  const KeyPair pair("ES256");
  const SigningKey key = keys_of(pair.jwk("a")).front();
  const std::string signature = pair.sign("text");
  EXPECT_TRUE(key.has_signed("text", signature));
  EXPECT_FALSE(key.has_signed("texT", signature));
  for (const std::string& other : {std::string(), signature.substr(1), signature + 'x',
                                   std::string(64, '\0'), std::string(64, '\xff')}) {
    EXPECT_FALSE(key.has_signed("text", other));
  }
}

}  // namespace
}  // namespace isomesh::oidc
