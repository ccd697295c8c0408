// A login provider that is away, turns its keys over, or lies.
#include "server/http/oidc/provider.h"

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/guards/access.h"
#include "server/http/server.h"
#include "server/net/address.h"
#include "tests/api/http.h"
#include "tests/support/errors.h"
#include "tests/support/login_provider.h"
#include "tests/support/process.h"
#include "tests/unit/http/services.h"

namespace isomesh::oidc {
namespace {

using namespace std::chrono_literals;
using test::KeyPair;
using test::LoginProvider;
using testing::HasSubstr;
using testing::Not;

class ProviderTest : public testing::Test {
 protected:
  ProviderTest() { peer_.publish(key_.jwk("one")); }

  // Reads again after a failure at once, but after an unknown key only if `soon`.
  ProviderOptions options(std::chrono::milliseconds between = 1h) const {
    ProviderOptions options;
    options.issuer = peer_.issuer();
    options.audience = "isomesh";
    options.times.between_reads = between;
    return options;
  }

  std::string token(const std::string& id = "one",
                    const std::string& more = R"("roles": "isomesh-user")") const {
    return signed_token(key_, test::head_of(key_, id),
                        test::claims_of(peer_.issuer(), "ann", more));
  }

  static std::string answer_of(const Provider& provider, const std::string& token) {
    try {
      return provider.login_of(token).caller.name;
    } catch (const Error& error) {
      return error.what();
    }
  }

  static bool comes_to(const Provider& provider, const std::string& token,
                       const std::string& text) {
    return test::eventually(
        [&] { return answer_of(provider, token).find(text) != std::string::npos; });
  }

  const KeyPair key_{"ES256"};
  LoginProvider peer_;
};

TEST_F(ProviderTest, AcceptsItsTokens) {
  const Provider provider(options());
  EXPECT_TRUE(comes_to(provider, token(), "oidc:ann"));
  EXPECT_EQ(provider.login_of(token()).caller, (http::Caller{"oidc:ann", http::Role::kUser}));
  EXPECT_EQ(peer_.reads(), 1);
}

TEST_F(ProviderTest, MayBeAwayAtTheStart) {
  peer_.break_with(500, "SECRET");
  const Provider provider(options(1ms));
  EXPECT_TRUE(comes_to(provider, token(), "the login provider cannot be reached"));
  EXPECT_EQ(test::code_thrown_by([&] { provider.login_of(token()); }), ErrorCode::kUnavailable);
  peer_.break_with(0);
  EXPECT_TRUE(comes_to(provider, token(), "oidc:ann"));
  // What was read once is used while it is away.
  peer_.break_with(500);
  EXPECT_EQ(answer_of(provider, token()), "oidc:ann");
}

TEST_F(ProviderTest, ANewKeyIsReadWhenATokenHasIt) {
  const Provider provider(options(0ms));
  EXPECT_TRUE(comes_to(provider, token(), "oidc:ann"));
  const int before = peer_.reads();
  peer_.publish(key_.jwk("two"));
  EXPECT_EQ(test::code_thrown_by([&] { provider.login_of(token("two")); }),
            ErrorCode::kUnavailable);
  EXPECT_TRUE(comes_to(provider, token("two"), "oidc:ann"));
  EXPECT_GT(peer_.reads(), before);
  // The old key is no longer published.
  EXPECT_THAT(answer_of(provider, token("one")), Not("oidc:ann"));
}

TEST_F(ProviderTest, StrangersCannotMakeItReadOftenKeys) {
  const Provider provider(options());
  EXPECT_TRUE(comes_to(provider, token(), "oidc:ann"));
  for (int i = 0; i < 100; ++i) {
    const Error error = test::error_of([&] { provider.login_of(token("k" + std::to_string(i))); });
    EXPECT_EQ(error.code(), ErrorCode::kUnauthorized);
  }
  EXPECT_EQ(peer_.reads(), 1);
}

TEST_F(ProviderTest, OldKeysAreNotUsedForEver) {
  ProviderOptions short_lived = options();
  short_lived.times.oldest = 0ms;
  const Provider provider(short_lived);
  EXPECT_TRUE(test::eventually([&] { return peer_.reads() > 0; }));
  EXPECT_EQ(test::code_thrown_by([&] { provider.login_of(token()); }), ErrorCode::kUnavailable);
}

TEST_F(ProviderTest, IsNotBelievedWhenItLies) {
  const auto is_refused = [&] {
    const Provider provider(options());
    return comes_to(provider, token(), "the login provider cannot be reached");
  };
  for (const auto& [name, value] : std::vector<std::pair<std::string, std::string>>{
           {"issuer", peer_.issuer() + "/"},
           {"issuer", "https://other.example"},
           {"jwks_uri", ""},
           {"jwks_uri", "file:///etc/passwd"},
           {"jwks_uri", "http://192.0.2.1/keys"},
           {"jwks_uri", "https://user:password@127.0.0.1/keys"}}) {
    const std::string usual = name == "issuer" ? peer_.issuer() : peer_.issuer() + "/keys";
    peer_.describe(name, value);
    EXPECT_TRUE(is_refused()) << name << ' ' << value;
    peer_.describe(name, usual);
  }
  for (const auto& [status, text] : std::vector<std::pair<int, std::string>>{
           {302, "{}"},
           {204, ""},
           {200, "<html>"},
           {200, "[]"},
           {200, R"({"issuer": ")" + peer_.issuer() + R"(", "issuer": ")" + peer_.issuer() + "\"}"},
           {200, '"' + std::string(300'000, 'x') + '"'}}) {
    peer_.break_with(status, text);
    EXPECT_TRUE(is_refused()) << status << ' ' << text.substr(0, 80);
  }
  EXPECT_EQ(peer_.reads(), 0);
  peer_.break_with(0);
  peer_.publish("");
  EXPECT_TRUE(is_refused());
}

TEST(ProviderOptions, AreChecked) {
  const auto fields = [](const ProviderOptions& options) {
    return test::fields_of(test::error_of([&] { check_options(options); }, options.issuer));
  };
  ProviderOptions good;
  good.issuer = "https://login.example/realms/x";
  good.audience = "isomesh";
  EXPECT_NO_THROW(check_options(good));
  for (const char* issuer :
       {"", "login.example", "http://login.example", "ftp://login.example", "https://",
        "https://a@login.example", "https://login.example?x=1", "https://login.example/#a",
        "https://login.example /", "https://a;b.example", "http://127.0.0.1.example",
        "http://localhost.example"}) {
    ProviderOptions wrong = good;
    wrong.issuer = issuer;
    EXPECT_EQ(fields(wrong), std::vector<std::string>{"oidc-issuer"}) << issuer;
  }
  for (const char* issuer : {"http://127.0.0.1:8080", "http://localhost/a", "http://[::1]:1",
                             "https://[2001:db8::1]/x"}) {
    ProviderOptions other = good;
    other.issuer = issuer;
    EXPECT_NO_THROW(check_options(other)) << issuer;
  }
  ProviderOptions wrong = good;
  wrong.audience = "";
  EXPECT_EQ(fields(wrong), std::vector<std::string>{"oidc-audience"});
  for (const std::vector<std::string>& roles :
       std::vector<std::vector<std::string>>{{"a"}, {"=user"}, {"a=root"}, {"a=user", "a=admin"}}) {
    wrong = good;
    wrong.roles = roles;
    EXPECT_EQ(fields(wrong), std::vector<std::string>{"oidc-role"}) << roles.front();
  }
  for (const char* parameter :
       {"scope", "state=x", "client_id=x", "redirect_uri=https://evil.example"}) {
    wrong = good;
    wrong.parameters = {parameter};
    EXPECT_EQ(fields(wrong), std::vector<std::string>{"oidc-parameter"}) << parameter;
  }
}

// A server with the provider alone.
class LoginTest : public ProviderTest {
 protected:
  explicit LoginTest(const std::string& client_id = "page")
      : provider_(with_client(options(), client_id)) {
    http::Services services = services_.all();
    services.provider = &provider_;
    server_.emplace(services, http::ServerOptions{});
    url_ = server_->bind(net::parse_address("127.0.0.1:0"));
    server_->start();
    EXPECT_TRUE(comes_to(provider_, token(), "oidc:ann"));
  }

  static ProviderOptions with_client(ProviderOptions options, const std::string& client_id) {
    options.client_id = client_id;
    options.parameters = {"scope=openid profile", "resource=https://isomesh.example/?a=b"};
    return options;
  }

  test::Answer get(const std::string& target, const test::Headers& headers = {}) const {
    return test::answer_to(url_, test::request("GET", target, "", headers));
  }
  test::Answer get_as(const std::string& token, const std::string& target = "/v1/jobs") const {
    return get(target, {{"Authorization", "Bearer " + token}});
  }

  http::OpenServices services_;
  Provider provider_;
  std::optional<http::Server> server_;
  std::string url_;
};

TEST_F(LoginTest, TokensOfTheProviderReachAsFarAsTheirRole) {
  EXPECT_EQ(get_as(token()).status, 200);
  EXPECT_EQ(get_as(token("one", R"("roles": "isomesh-admin")"), "/metrics").status, 200);
  EXPECT_EQ(get_as(token(), "/metrics").status, 403);
  EXPECT_EQ(get_as(token("one", R"("roles": "isomesh-monitor")")).status, 403);
  const test::Answer nobody = get_as(token("one", ""));
  EXPECT_EQ(nobody.status, 403);
  EXPECT_THAT(nobody.body, HasSubstr("gives you no role"));
}

TEST_F(LoginTest, OthersAreRefusedAsProblems) {
  const KeyPair other("ES256");
  const std::string forged =
      signed_token(other, test::head_of(other, "one"), test::claims_of(peer_.issuer(), "ann"));
  const std::string huge = signed_token(
      key_, test::head_of(key_, "one"),
      test::claims_of(peer_.issuer(), "ann", "\"a\": \"" + std::string(5900, 'x') + '"'));
  for (const std::string& wrong :
       {std::string(), std::string("isomesh_unknown"), std::string("a.b.c"), forged, huge}) {
    const test::Answer answer = get_as(wrong);
    EXPECT_EQ(answer.status, 401) << wrong.substr(0, 80);
    EXPECT_EQ(answer.header("content-type"), "application/problem+json");
    EXPECT_EQ(answer.header("www-authenticate"), "Bearer realm=\"isomesh\"");
  }
  EXPECT_EQ(get_as(std::string(9000, 'x') + ".a.b").status, 431);
  EXPECT_THAT(get_as(forged).body, HasSubstr("it was not signed by the login provider"));
  EXPECT_EQ(get("/v1/jobs").status, 401);
  EXPECT_EQ(get("/livez").status, 200);
}

TEST_F(LoginTest, ThePageLearnsHowToLogIn) {
  const test::Answer login = get("/login");
  EXPECT_EQ(login.status, 200);
  EXPECT_EQ(login.body,
            R"({"tokens":false,"provider":{"issuer":")" + peer_.issuer() +
                R"(","client_id":"page","authorization_endpoint":")" + peer_.issuer() +
                R"(/authorize","token_endpoint":")" + peer_.issuer() +
                R"(/token","token":"access_token","parameters":{"scope":"openid profile",)"
                R"("resource":"https://isomesh.example/?a=b"}}})");
  EXPECT_THAT(get("/").header("content-security-policy"),
              HasSubstr("connect-src 'self' " + peer_.issuer() + ';'));
}

TEST_F(LoginTest, WhatLastsEndsWithTheToken) {
  http::Request request;
  request.path = "/v1/events";
  request.headers = {{"Authorization", "Bearer " + token()}};
  http::Response response;
  http::begin_request({nullptr, &provider_}, request, response);
  auto now = std::chrono::system_clock::now();
  const auto is_valid = http::validity_of({nullptr, &provider_}, request, [&] { return now; });
  EXPECT_TRUE(is_valid());
  now += 1h;  // and the clocks may differ by a minute
  EXPECT_TRUE(is_valid());
  now += 2min;
  EXPECT_FALSE(is_valid());
}

class PlainLoginTest : public LoginTest {
 protected:
  PlainLoginTest() : LoginTest("") {}
};

TEST_F(PlainLoginTest, ThePageHasNoneWithoutAClient) {
  EXPECT_EQ(get("/login").body, R"({"tokens":false,"provider":null})");
  EXPECT_THAT(get("/").header("content-security-policy"), HasSubstr("connect-src 'self';"));
}

}  // namespace
}  // namespace isomesh::oidc
