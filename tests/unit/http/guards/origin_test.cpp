#include "server/http/guards/origin.h"

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::http {
namespace {

Request request_of(const std::string& method, const std::string& host,
                   const std::string& origin = {}) {
  Request request;
  request.method = method;
  request.version = "HTTP/1.1";
  request.headers.emplace_back("Host", host);
  if (!origin.empty()) request.headers.emplace_back("Origin", origin);
  return request;
}

bool is_refused(const OriginRules& rules, const Request& request) {
  const auto code = test::code_thrown_by([&] { check_origin(rules, request); });
  EXPECT_TRUE(!code || code == ErrorCode::kForbidden);
  return code.has_value();
}

TEST(HostOf, TakesThePortAway) {
  EXPECT_EQ(host_of("LocalHost:8080"), "localhost");
  EXPECT_EQ(host_of("127.0.0.1"), "127.0.0.1");
  EXPECT_EQ(host_of("[::1]:80"), "[::1]");
  EXPECT_EQ(host_of("[::1]"), "[::1]");
  EXPECT_EQ(host_of(""), "");
  for (const std::string none : {"a:b", "localhost:80:80", "[::1", "localhost:80@evil"}) {
    EXPECT_EQ(host_of(none), "") << none;
  }
}

// --listen and --allow-host name addresses without brackets, too.
TEST(HostNamed, IsTheOneThatRequestsName) {
  for (const std::string setting : {"2001:db8::5", "[2001:db8::5]", "[2001:DB8::5]:8080"}) {
    EXPECT_EQ(host_named(setting), host_of("[2001:db8::5]:8080")) << setting;
  }
  EXPECT_EQ(host_named("Viewer.local:80"), "viewer.local");
  for (const std::string none : {"", "a:b", "2001:db8::zz", "[::1"}) {
    EXPECT_EQ(host_named(none), "") << none;
  }
}

TEST(Host, MustBeOursWhereItIsChecked) {
  const OriginRules rules = {.cors_origins = {}, .check_host = true, .hosts = {"viewer.local"}};
  for (const std::string ours : {"localhost:8080", "127.0.0.1:1", "127.1.2.3", "[::1]:8080",
                                 "viewer.local:80", "LOCALHOST"}) {
    EXPECT_FALSE(is_refused(rules, request_of("GET", ours))) << ours;
  }
  for (const std::string other : {"evil.example", "evil.example:8080", "", "127.0.0.1.evil.example",
                                  "localhost.evil.example", "192.168.0.1", "::1", "[::2]"}) {
    EXPECT_TRUE(is_refused(rules, request_of("GET", other))) << other;
    EXPECT_FALSE(is_refused({}, request_of("GET", other))) << other;
  }
}

TEST(Origin, OfAnotherPageMayChangeNothing) {
  const OriginRules rules = {
      .cors_origins = {"https://viewer.example"}, .check_host = false, .hosts = {}};
  for (const std::string other : {"https://evil.example", "null", "http://viewer.example",
                                  "https://viewer.example.evil", "localhost:8080", "x"}) {
    EXPECT_TRUE(is_refused(rules, request_of("POST", "localhost:8080", other))) << other;
    EXPECT_TRUE(is_refused(rules, request_of("DELETE", "localhost:8080", other))) << other;
    EXPECT_FALSE(is_refused(rules, request_of("GET", "localhost:8080", other))) << other;
  }
  for (const std::string allowed :
       {"https://viewer.example", "http://localhost:8080", "https://localhost:8080"}) {
    EXPECT_FALSE(is_refused(rules, request_of("POST", "localhost:8080", allowed))) << allowed;
  }
  EXPECT_FALSE(is_refused({}, request_of("POST", "localhost:8080")));
  EXPECT_FALSE(is_refused({.cors_origins = {"*"}, .check_host = false, .hosts = {}},
                          request_of("POST", "localhost:8080", "https://evil.example")));
}

TEST(Origin, IsSpelledAsBrowsersDo) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"https://viewer.example", "https://viewer.example"},
      {"https://viewer.example/", "https://viewer.example"},
      {"https://viewer.example/a/b?c#d", "https://viewer.example"},
      {"https://viewer.example?c", "https://viewer.example"},
      {"HTTPS://Viewer.Example:8443", "https://viewer.example:8443"},
      {"https://viewer.example:443", "https://viewer.example"},
      {"https://viewer.example:", "https://viewer.example"},
      {"https://viewer.example:08443", "https://viewer.example:8443"},
      {"http://viewer.example:80", "http://viewer.example"},
      {"http://viewer.example:443", "http://viewer.example:443"},
      {"viewer.example", "https://viewer.example"},
      {"viewer.example:8443/", "https://viewer.example:8443"},
      {"http://[::1]:8080/", "http://[::1]:8080"}};
  for (const auto& [address, origin] : cases) {
    EXPECT_EQ(origin_of(address), origin) << address;
    EXPECT_EQ(origin_of(origin), origin) << address;
  }
  for (const std::string none :
       {"", "*", "https://", "https:///x", "ftp://viewer.example", "file:///x", "https://*.example",
        "https://a b", "https://me@viewer.example", "https://viewer.example:x", "https://a:70000",
        "https://a:99999999999999999999", "https://m\xc3\xbcller.example", "https://[::1", "a,b"}) {
    EXPECT_EQ(origin_of(none), "") << none;
  }
}

}  // namespace
}  // namespace isomesh::http
