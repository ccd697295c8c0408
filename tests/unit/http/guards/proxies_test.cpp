#include "server/http/guards/proxies.h"

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::http {
namespace {

Request from(const std::string& address, const net::Headers& headers) {
  Request request;
  request.remote_address = address;
  request.headers = headers;
  return request;
}

const TrustedProxies kProxies({"10.1.0.0/16", "2001:db8::7"}, ClientHeader::kXForwardedFor);
const TrustedProxies kForwarding({"10.1.0.0/16", "unix"}, ClientHeader::kForwarded);

TEST(TrustedProxies, TellTheClient) {
  EXPECT_EQ(kProxies.client_of(from("10.1.2.3", {{"x-forwarded-for", "192.0.2.5"}})), "192.0.2.5");
  EXPECT_EQ(kProxies.client_of(from("2001:db8::7", {{"X-Forwarded-For", "192.0.2.5:80"}})),
            "192.0.2.5");
  EXPECT_EQ(kProxies.client_of(from("::ffff:10.1.2.3", {{"X-Forwarded-For", "[2001:db8::9]:80"}})),
            "2001:db8::9");
}

TEST(TrustedProxies, AreBelievedAsFarAsTheyReach) {
  const net::Headers forged = {{"X-Forwarded-For", "203.0.113.1, 198.51.100.4 ,10.1.9.9"}};
  EXPECT_EQ(kProxies.client_of(from("10.1.2.3", forged)), "198.51.100.4");
  const net::Headers two = {{"X-Forwarded-For", "203.0.113.1, 198.51.100.4"},
                            {"X-Forwarded-For", "10.1.9.9"}};
  EXPECT_EQ(kProxies.client_of(from("10.1.2.3", two)), "198.51.100.4");
  const net::Headers all = {{"X-Forwarded-For", "10.1.9.8, 10.1.9.9"}};
  EXPECT_EQ(kProxies.client_of(from("10.1.2.3", all)), "10.1.9.8");
}

TEST(TrustedProxies, OthersAreNotBelieved) {
  const net::Headers forged = {{"X-Forwarded-For", "203.0.113.1"}};
  EXPECT_EQ(kProxies.client_of(from("10.2.0.1", forged)), "10.2.0.1");
  EXPECT_EQ(kProxies.client_of(from("2001:db8::8", forged)), "2001:db8::8");
  EXPECT_EQ(kProxies.client_of(from("", forged)), "");
  EXPECT_EQ(TrustedProxies().client_of(from("10.1.2.3", forged)), "10.1.2.3");
}

// The proxy's own address is the last one that is known for sure.
TEST(TrustedProxies, KeepTheirAddressIfTheyTellNone) {
  for (const char* value :
       {"", "unknown", "203.0.113.1, _hidden", "203.0.113.1,", "1.2.3", "[::1"}) {
    EXPECT_EQ(kProxies.client_of(from("10.1.2.3", {{"X-Forwarded-For", value}})), "10.1.2.3")
        << value;
  }
  EXPECT_EQ(kProxies.client_of(from("10.1.2.3", {})), "10.1.2.3");
}

TEST(TrustedProxies, TellTheClientInTheOneHeaderThatIsTheirs) {
  const net::Headers both = {{"X-Forwarded-For", "203.0.113.1"},
                             {"Forwarded", "for=198.51.100.4;proto=http, For=\"[2001:db8::9]:4\""}};
  EXPECT_EQ(kForwarding.client_of(from("", both)), "2001:db8::9");
  EXPECT_EQ(kForwarding.client_of(from("10.1.0.1", both)), "2001:db8::9");
  EXPECT_EQ(kProxies.client_of(from("10.1.0.1", both)), "203.0.113.1");
}

TEST(TrustedProxies, AreAddressesOrNetworks) {
  for (const char* text : {"", "proxy", "10.1", "10.1.0.0/33", "::1/129", "10.1.0.0/",
                           "10.1.0.0/-1", "10.1.0.0/16/2"}) {
    EXPECT_EQ(test::code_thrown_by([&] { TrustedProxies({text}, {}); }),
              ErrorCode::kInvalidParameter)
        << text;
  }
  const TrustedProxies everybody({"0.0.0.0/0", "2001:db8::/33"}, {});
  const net::Headers headers = {{"X-Forwarded-For", "192.0.2.5"}};
  EXPECT_EQ(everybody.client_of(from("203.0.113.1", headers)), "192.0.2.5");
  EXPECT_EQ(everybody.client_of(from("2001:db8:7fff::1", headers)), "192.0.2.5");
  EXPECT_EQ(everybody.client_of(from("2001:db8:8000::1", headers)), "2001:db8:8000::1");
}

}  // namespace
}  // namespace isomesh::http
