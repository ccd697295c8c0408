#include "client/isomesh/url.h"

#include <gtest/gtest.h>

#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

TEST(ServerAddress, IsReadInEveryForm) {
  const auto expect = [](const std::string& url, const ServerAddress& address) {
    EXPECT_EQ(parse_server_address(url), address) << url;
  };
  expect("http://127.0.0.1:8080", {"http://127.0.0.1:8080"});
  expect("http://localhost/", {"http://localhost"});
  expect("https://meshes.example.org", {"https://meshes.example.org"});
  expect("https://meshes.example.org:8443/", {"https://meshes.example.org:8443"});
  expect("http://[::1]:8080", {"http://[::1]:8080"});
  expect("http://[::1]", {"http://[::1]"});
  expect("unix:/run/isomesh/http.sock", {"http://localhost", "/run/isomesh/http.sock"});
}

TEST(ServerAddress, RefusesEverythingElse) {
  for (const std::string url :
       {"",           "localhost:8080", "ftp://a",      "http://",          "http://:80",
        "http://a:0", "http://a:65536", "http://a:8o",  "http://a:",        "http://a/v1",
        "http://u@a", "http://a b",     "http://[::1",  "http://[::1]8080", "http://a?b",
        "http://a#b", "http://a\\b",    "http://a%2Fb", "http:///",         "http://a\r\nX: y",
        "unix:"}) {
    EXPECT_EQ(test::error_of([&] { parse_server_address(url); }).code(),
              ErrorCode::kInvalidParameter)
        << url;
  }
  EXPECT_EQ(test::error_of([] { parse_server_address("http://" + std::string(9000, 'a')); }).code(),
            ErrorCode::kInvalidParameter);
}

TEST(QueryString, JoinsEncodedPairs) {
  EXPECT_EQ(query_string({}), "");
  EXPECT_EQ(query_string({{"a", "1,2"}, {"b&", "="}}), "?a=1%2C2&b%26=%3D");
}

}  // namespace
}  // namespace isomesh
