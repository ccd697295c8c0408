#include "server/http/guards/origin.h"

#include <string>

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

}  // namespace
}  // namespace isomesh::http
