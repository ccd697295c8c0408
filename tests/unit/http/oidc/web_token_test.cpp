// Tokens that lie.
#include "server/http/oidc/web_token.h"

#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "base/base64.h"
#include "tests/support/errors.h"
#include "tests/support/login_provider.h"

namespace isomesh::oidc {
namespace {

using http::Caller;
using http::Role;
using test::claims_of;
using test::head_of;
using test::KeyPair;
using test::signed_token;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kIssuer = "https://login.example";

const KeyPair& curve_pair() {
  static const KeyPair key("ES256");
  return key;
}

const KeyPair& rsa_pair() {
  static const KeyPair key("RS256");
  return key;
}

TokenRules usual_rules() {
  return {.issuer = kIssuer,
          .audience = "isomesh",
          .role_claim = "roles",
          .roles = {{"isomesh-user", Role::kUser},
                    {"isomesh-admin", Role::kAdmin},
                    {"isomesh-monitor", Role::kMonitor}}};
}

Login check(const std::string& token, const TokenRules& rules = usual_rules(),
            const std::string& more_keys = {}) {
  static const std::vector<SigningKey> usual =
      read_keys(R"({"keys": [)" + curve_pair().jwk("curve") + ", " + rsa_pair().jwk("rsa") + "]}");
  const auto keys = more_keys.empty() ? usual : read_keys(R"({"keys": [)" + more_keys + "]}");
  return check_token(token, read_head(token), keys, rules, std::chrono::system_clock::now());
}

std::string with_claims(const std::string& claims) {
  return signed_token(curve_pair(), head_of(curve_pair(), "curve"), claims);
}

std::string with_head(const std::string& head) {
  return signed_token(curve_pair(), head, claims_of(kIssuer, "ann"));
}

// The reason why it is not accepted, which never holds any of it.
std::string refusal_of(const std::string& token) {
  const Error error = test::error_of([&] { check(token); }, token.substr(0, 200));
  EXPECT_EQ(error.code(), ErrorCode::kUnauthorized) << error.what();
  EXPECT_THAT(error.what(), Not(HasSubstr("SECRET")));
  return error.what();
}

TEST(WebToken, IsOfItsSubject) {
  const Login login = check(with_claims(claims_of(kIssuer, "ann")));
  EXPECT_EQ(login.caller, (Caller{"oidc:ann", Role::kUser}));
  EXPECT_GT(login.expires, std::chrono::system_clock::now() + std::chrono::minutes(59));
  EXPECT_LT(login.expires, std::chrono::system_clock::now() + std::chrono::minutes(62));
}

TEST(WebToken, IsSignedInThreeWays) {
  const KeyPair pss("PS256");
  for (const KeyPair& key : {curve_pair(), rsa_pair(), pss}) {
    const std::string token = signed_token(key, head_of(key, "k"), claims_of(kIssuer, "ann"));
    EXPECT_EQ(check(token, usual_rules(), key.jwk("k")).caller.name, "oidc:ann") << key.algorithm();
    std::string changed = token;
    changed[changed.find('.') + 9] ^= 1;
    EXPECT_TRUE(test::thrown_by([&] { check(changed, usual_rules(), key.jwk("k")); }));
  }
  // The same numbers, but the key says how it signs.
  const std::string other = signed_token(pss, head_of(rsa_pair(), "k"), claims_of(kIssuer, "ann"));
  EXPECT_TRUE(test::thrown_by([&] { check(other, usual_rules(), pss.jwk("k")); }));
}

TEST(WebToken, WithoutASignatureIsRefused) {
  const std::string claims = test::to_base64url(claims_of(kIssuer, "ann"));
  for (const std::string algorithm : {"none", "None", "nOnE", ""}) {
    const std::string head =
        test::to_base64url(R"({"alg": ")" + algorithm + R"(", "kid": "curve"})");
    refusal_of(head + '.' + claims + '.');
    refusal_of(head + '.' + claims + ".AAAA");
  }
  const std::string token = with_claims(claims_of(kIssuer, "ann"));
  refusal_of(token.substr(0, token.rfind('.') + 1));
  refusal_of(token.substr(0, token.rfind('.') + 1) + std::string(86, 'A'));  // zeros
  for (const std::string shape : {"", ".", "..", "...", "a.b", "a.b.c.d", "a.b.c.d.e"})
    refusal_of(shape);
}

// The public key as the secret of HS256: a token that says how it is to be checked would pass.
TEST(WebToken, OfTheWrongAlgorithmIsRefused) {
  const std::string text = test::to_base64url(R"({"alg": "HS256", "kid": "rsa"})") + '.' +
                           test::to_base64url(claims_of(kIssuer, "ann"));
  const std::string secret = rsa_pair().public_pem();
  std::string mac(EVP_MAX_MD_SIZE, '\0');
  unsigned size = 0;
  HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
       reinterpret_cast<const unsigned char*>(text.data()), text.size(),
       reinterpret_cast<unsigned char*>(mac.data()), &size);
  mac.resize(size);
  EXPECT_THAT(refusal_of(text + '.' + test::to_base64url(mac)), HasSubstr("not signed"));
  for (const char* algorithm : {"RS384", "ES384", "PS256", "RS256 ", "rs256", "EdDSA"}) {
    const std::string head = std::string(R"({"alg": ")") + algorithm + R"(", "kid": "rsa"})";
    EXPECT_THAT(refusal_of(signed_token(rsa_pair(), head, claims_of(kIssuer, "ann"))),
                HasSubstr("not signed"));
  }
}

TEST(WebToken, OfAnotherKeyIsRefused) {
  const KeyPair other("ES256");
  EXPECT_THAT(refusal_of(signed_token(other, head_of(other, "curve"), claims_of(kIssuer, "ann"))),
              HasSubstr("not signed"));
  // A key that the token brings along, or the place of one, is not looked at.
  const std::string brought = R"({"alg": "ES256", "kid": "curve", "jwk": )" + other.jwk("curve") +
                              R"(, "jku": "https://evil.example/SECRET"})";
  EXPECT_THAT(refusal_of(signed_token(other, brought, claims_of(kIssuer, "ann"))),
              HasSubstr("not signed"));
}

TEST(WebToken, NamesItsKey) {
  for (const char* id : {"../../etc/passwd", "/dev/null", "curve\\u0000", "Curve", "' OR 1=1 --",
                         "https://evil.example/keys"}) {
    const std::string head = std::string(R"({"alg": "ES256", "kid": ")") + id + "\"}";
    EXPECT_THAT(refusal_of(with_head(head)), HasSubstr("not signed")) << id;
  }
  for (const char* head :
       {R"({"alg": "ES256"})", R"({"alg": "ES256", "kid": ""})", R"({"alg": "ES256", "kid": 1})",
        R"({"alg": "ES256", "kid": ["curve"]})"}) {
    EXPECT_THAT(refusal_of(with_head(head)), HasSubstr("names no key")) << head;
  }
}

TEST(WebToken, OfSomebodyElseIsRefused) {
  EXPECT_THAT(refusal_of(with_claims(claims_of("https://login.example/", "ann"))),
              HasSubstr("another issuer"));
  const std::string head = R"({"iss": "https://login.example", "sub": "ann", "exp": 9999999999)";
  EXPECT_THAT(refusal_of(with_claims(head + '}')), HasSubstr("no audience"));
  for (const char* audience : {R"("other")", R"("isomesh ")", R"(["other"])", "[]", "1", "null",
                               R"("isomesh other")", R"([["isomesh"]])", R"({"isomesh": 1})"}) {
    EXPECT_THAT(refusal_of(with_claims(head + R"(, "aud": )" + audience + '}')),
                HasSubstr("another audience"))
        << audience;
  }
  const std::string roles = R"(, "roles": "isomesh-user")";
  EXPECT_EQ(check(with_claims(head + R"(, "aud": ["other", "isomesh"])" + roles + '}')).caller.name,
            "oidc:ann");
}

TEST(WebToken, HoldsForItsTimeAndOneMinute) {
  const std::int64_t now = test::unix_time();
  const auto token = [](const std::string& times) {
    return with_claims(R"({"iss": "https://login.example", "aud": "isomesh", "sub": "ann", )"
                       R"("roles": "isomesh-user")" +
                       times + '}');
  };
  const auto at = [&](const char* name, std::int64_t time) {
    return std::string(", \"") + name + "\": " + std::to_string(time);
  };
  EXPECT_THAT(refusal_of(token("")), HasSubstr("never expires"));
  EXPECT_THAT(refusal_of(token(at("exp", now - 61))), HasSubstr("has expired"));
  EXPECT_NO_THROW(check(token(at("exp", now - 50))));
  EXPECT_NO_THROW(check(token(R"(, "exp": 9999999999.5)")));
  EXPECT_NO_THROW(check(token(R"(, "exp": 253402300799)")));
  for (const char* name : {"nbf", "iat"}) {
    EXPECT_THAT(refusal_of(token(at("exp", now + 900) + at(name, now + 75))),
                HasSubstr("not valid yet"));
    EXPECT_NO_THROW(check(token(at("exp", now + 900) + at(name, now + 50))));
  }
  for (const char* time : {"-1", "1e300", "\"9999999999\"", "null", "true", "[]"}) {
    EXPECT_THAT(refusal_of(token(std::string(R"(, "exp": )") + time)), HasSubstr("no time"))
        << time;
  }
}

TEST(WebToken, HasOneMeaning) {
  const std::string claims = claims_of(kIssuer, "ann");
  const std::string inner = claims.substr(1, claims.size() - 2);
  EXPECT_THAT(refusal_of(with_claims(R"({"sub": "boss", )" + inner + '}')),
              HasSubstr("two members of one name"));
  EXPECT_THAT(refusal_of(with_claims(R"({"\u0073ub": "boss", )" + inner + '}')),
              HasSubstr("two members of one name"));
  EXPECT_THAT(refusal_of(with_claims(R"({"more": {"a": 1, "a": 2}, )" + inner + '}')),
              HasSubstr("two members of one name"));
  EXPECT_THAT(refusal_of(with_head(R"({"alg": "ES256", "kid": "curve", "kid": "rsa"})")),
              HasSubstr("two members of one name"));
  const auto nested = [&](std::size_t depth) {
    return with_claims(R"({"deep": )" + std::string(depth, '[') + std::string(depth, ']') + ", " +
                       inner + '}');
  };
  EXPECT_THAT(refusal_of(nested(100)), HasSubstr("too deep"));
  EXPECT_THAT(refusal_of(nested(1000)), HasSubstr("no JSON object"));  // for any JSON
  for (const std::string& text :
       {claims + claims, claims + std::string(1, '\0') + "more", std::string("[]"),
        std::string("1"), std::string(), claims.substr(0, claims.size() - 1),
        std::string("{\"a\": \"\xff\"}")}) {
    EXPECT_THAT(refusal_of(with_claims(text)), HasSubstr("no JSON object")) << text;
  }
}

TEST(WebToken, OfAnotherPurposeIsRefused) {
  for (const char* type : {"logout+jwt", "secevent+jwt", "JWE", "", "dpop+jwt"}) {
    EXPECT_THAT(refusal_of(with_head(std::string(R"({"alg": "ES256", "kid": "curve", "typ": ")") +
                                     type + "\"}")),
                HasSubstr("another purpose"));
  }
  for (const char* type : {"JWT", "at+jwt", "application/at+jwt", "AT+JWT"}) {
    EXPECT_NO_THROW(check(
        with_head(std::string(R"({"alg": "ES256", "kid": "curve", "typ": ")") + type + "\"}")));
  }
  for (const char* asked :
       {R"("crit": ["exp"])", R"("b64": false)", R"("zip": "DEF")", R"("enc": "A128GCM")"}) {
    EXPECT_THAT(
        refusal_of(with_head(std::string(R"({"alg": "ES256", "kid": "curve", )") + asked + '}')),
        HasSubstr("not supported"));
  }
}

TEST(WebToken, IsSpelledInOneWay) {
  const std::string token = with_claims(claims_of(kIssuer, "ann"));
  const std::size_t last = token.rfind('.');
  const std::string other(1, token.back() == 'A' ? 'B' : static_cast<char>(token.back() + 1));
  for (const std::string& changed : std::vector<std::string>{
           token + "=", token + "==", ' ' + token, token.substr(0, 5) + '\n' + token.substr(5),
           token + ' ', token.substr(0, last + 1) + '+' + token.substr(last + 2),
           token.substr(0, token.size() - 1) + other}) {
    refusal_of(changed);
  }
}

TEST(WebToken, HasASubjectThatCanBeAnOwner) {
  for (const std::string subject : {"", "a\\nb", "a\\u0000", "\u00e4"}) {
    EXPECT_THAT(refusal_of(with_claims(claims_of(kIssuer, subject))), HasSubstr("\"sub\""));
  }
  refusal_of(with_claims(claims_of(kIssuer, std::string(256, 'a'))));
  EXPECT_EQ(check(with_claims(claims_of(kIssuer, "auth0|5f CN=Ann,O=X"))).caller.name,
            "oidc:auth0|5f CN=Ann,O=X");
}

TEST(WebToken, HasTheRoleThatAllowsMost) {
  const auto role_of = [](const std::string& claims, const TokenRules& rules) {
    return check(with_claims(claims_of(kIssuer, "ann", claims)), rules).caller.role;
  };
  const TokenRules usual = usual_rules();
  EXPECT_EQ(role_of(R"("roles": ["x", "isomesh-monitor"])", usual), Role::kMonitor);
  EXPECT_EQ(role_of(R"("roles": ["isomesh-monitor", "isomesh-user"])", usual), Role::kUser);
  EXPECT_EQ(role_of(R"("roles": "isomesh-user isomesh-admin")", usual), Role::kAdmin);
  for (const char* none :
       {"", R"("roles": [])", R"("roles": ["isomesh-admins", 1, null, ["isomesh-admin"]])",
        R"("roles": {"isomesh-admin": true})", R"("groups": ["isomesh-admin"])",
        R"("roles": "*")"}) {
    EXPECT_EQ(test::code_thrown_by([&] { role_of(none, usual); }), ErrorCode::kForbidden) << none;
  }
  TokenRules deep = usual;
  deep.role_claim = "realm_access.roles";
  EXPECT_EQ(role_of(R"("realm_access": {"roles": ["isomesh-admin"]})", deep), Role::kAdmin);
  EXPECT_EQ(role_of(R"("realm_access.roles": ["isomesh-admin"])", deep), Role::kAdmin);
  EXPECT_EQ(test::code_thrown_by(
                [&] { role_of(R"("realm_access": [{"roles": "isomesh-admin"}])", deep); }),
            ErrorCode::kForbidden);
  TokenRules all = usual;
  all.roles["*"] = Role::kUser;
  EXPECT_EQ(role_of("", all), Role::kUser);
  EXPECT_EQ(role_of(R"("roles": ["isomesh-admin"])", all), Role::kAdmin);
}

}  // namespace
}  // namespace isomesh::oidc
