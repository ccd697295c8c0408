#include "server/net/address.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::net {
namespace {

using testing::ElementsAre;

TEST(ParseAddress, TakesHostAndPort) {
  const Address address = parse_address("127.0.0.1:8080");
  EXPECT_EQ(address.host, "127.0.0.1");
  EXPECT_EQ(address.port, 8080);
  EXPECT_FALSE(address.is_unix());
  EXPECT_EQ(parse_address("localhost:0").port, 0);
  EXPECT_EQ(parse_address("0.0.0.0:65535").port, 65535);
}

TEST(ParseAddress, TakesIpv6InBrackets) {
  const Address address = parse_address("[::1]:80");
  EXPECT_EQ(address.host, "::1");
  EXPECT_EQ(address.port, 80);
}

TEST(ParseAddress, TakesAUnixSocket) {
  const Address address = parse_address("unix:/run/isomesh/http.sock");
  EXPECT_TRUE(address.is_unix());
  EXPECT_EQ(address.unix_path, "/run/isomesh/http.sock");
  EXPECT_EQ(parse_address("unix:relative.sock").unix_path, "relative.sock");
}

TEST(ParseAddress, RefusesTheRest) {
  for (const std::string& text :
       {std::string(), std::string(":"), std::string(":8080"), std::string("127.0.0.1"),
        std::string("127.0.0.1:"), std::string("127.0.0.1:x"), std::string("127.0.0.1:-1"),
        std::string("127.0.0.1:+1"), std::string("127.0.0.1:65536"),
        std::string("127.0.0.1:99999999999"), std::string("127.0.0.1:80 "),
        std::string("127.0.0.1:8080/"), std::string("[]:80"), std::string("unix:"),
        "unix:/" + std::string(107, 'x')}) {
    const Error error = test::error_of([&] { parse_address(text); }, text);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(test::fields_of(error), ElementsAre("listen"));
  }
}

TEST(Address, KnowsWhatStaysOnTheMachine) {
  for (const std::string text :
       {"127.0.0.1:1", "127.1.2.3:1", "localhost:1", "[::1]:1", "unix:a"}) {
    EXPECT_TRUE(parse_address(text).is_loopback()) << text;
  }
  for (const std::string text :
       {"0.0.0.0:1", "192.168.0.1:1", "[::]:1", "example.org:1", "localhost.example.org:1"}) {
    EXPECT_FALSE(parse_address(text).is_loopback()) << text;
  }
}

// A name that begins like an address is still somebody else's.
TEST(Address, ANameThatLooksLikeLoopbackIsNot) {
  EXPECT_FALSE(parse_address("127.example.org:1").is_loopback());
}

// A host has as many addresses of IPv6 as it likes, within its network.
TEST(Address, WhoSharesLimits) {
  EXPECT_EQ(party_of("192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(party_of("::ffff:192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(party_of("2001:db8:1:2::1"), party_of("2001:db8:1:2:ffff::7"));
  EXPECT_NE(party_of("2001:db8:1:2::1"), party_of("2001:db8:1:3::1"));
  EXPECT_EQ(party_of(""), "");
}

}  // namespace
}  // namespace isomesh::net
