#include "server/callbacks/targets.h"

#include <string>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>

#include "tests/support/errors.h"

namespace isomesh::callbacks {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const CallbackTargets kTargets({"https://ris.example.org/hooks/iso",
                                "http://plain.example.org:8080",
                                "private:https://pacs.hospital.lan/", "http://127.0.0.1:9000/in"});

TEST(CallbackTargets, AllowWhatBeginsAsAnEntry) {
  for (const std::string url :
       {"https://ris.example.org/hooks/iso", "https://ris.example.org/hooks/iso/job?x=1",
        "https://RIS.example.org:443/hooks/iso", "https://ris.example.org/hooks/iso/a;b=c/d%20e",
        "https://ris.example.org/hooks/iso?a=%25", "http://plain.example.org:8080/any/where",
        "http://plain.example.org:8080", "https://pacs.hospital.lan/a",
        "http://127.0.0.1:9000/in"}) {
    EXPECT_NO_THROW(kTargets.check(url)) << url;
  }
}

TEST(CallbackTargets, AllowNothingElse) {
  for (const std::string url : {"https://ris.example.org.evil.com/hooks/iso",
                                "https://ris.example.org/hooks/isolated",
                                "https://ris.example.org/hooks",
                                "http://ris.example.org/hooks/iso",
                                "https://ris.example.org:8443/hooks/iso",
                                "http://plain.example.org/",
                                "http://plain.example.org:80800/",
                                "http://127.0.0.1:9000/",
                                "http://localhost:9000/in",
                                "http://2130706433:9001/in",
                                "https://ris.example.org@evil.com/hooks/iso",
                                "https://user@ris.example.org/hooks/iso",
                                "https://ris.example.org/hooks/iso#part",
                                "https://ris.example.org/hooks/iso/../../admin",
                                "https://ris.example.org/hooks/iso/%2e%2e/x",
                                "https://ris.example.org/hooks/iso%2Fx",
                                "https://ris.example.org/hooks/iso\\x",
                                "https://ris.example.org/hooks/iso/..;/admin",
                                "https://ris.example.org/hooks/iso/..;x=1/admin",
                                "https://ris.example.org/hooks/iso/.;/x",
                                "https://ris.example.org/hooks/iso/;/x",
                                "https://ris.example.org/hooks/iso/%252e%252e/admin",
                                "https://ris.example.org/hooks/iso%252fx",
                                "https://ris.example.org/hooks/iso/%25252e%25252e/admin",
                                "https://ris.example.org/hooks/iso/..%3b/admin",
                                "https://ris.example.org/hooks/iso/..%253b/admin",
                                "https://ris.example.org/hooks/iso/%00",
                                "https://ris.example.org/hooks/iso/%zz",
                                "https://ris.example.org/hooks/iso/%",
                                "https://ris.example.org//hooks/iso",
                                "file:///etc/passwd",
                                "gopher://plain.example.org:8080/",
                                "ris.example.org/hooks/iso",
                                "//ris.example.org/hooks/iso",
                                "https:ris.example.org",
                                "https://ris.example.org/hooks/iso\r\nX: y",
                                "https://ris.example.org/hooks/iso x",
                                "https://[::1]/hooks/iso",
                                "https://[fe80::1%25eth0]/",
                                "",
                                "https://"}) {
    const Error error = test::error_of([&] { kTargets.check(url); }, url);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(test::fields_of(error), ElementsAre("callback.url"));
  }
  const std::string longer = "https://ris.example.org/hooks/iso/" + std::string(2000, 'x');
  EXPECT_TRUE(test::thrown_by([&] { kTargets.check(longer); }));
}

TEST(CallbackTargets, KnowNobodyByDefault) {
  const CallbackTargets none({});
  EXPECT_TRUE(none.empty());
  EXPECT_TRUE(test::thrown_by([&] { none.check("https://ris.example.org/hooks/iso"); }));
}

TEST(CallbackTargets, AnEntryThatIsNoneIsRefusedByName) {
  for (const std::string entry : {"ris.example.org", "ftp://ris.example.org/", "https://a@b/",
                                  "https://ris.example.org/?x", "private:", ""}) {
    const Error error = test::error_of([&] { CallbackTargets({entry}); }, entry);
    EXPECT_THAT(error.what(), HasSubstr('"' + entry + '"'));
  }
}

bool reaches(Reach reach, const std::string& address) {
  sockaddr_storage storage = {};
  auto& v4 = reinterpret_cast<sockaddr_in&>(storage);
  auto& v6 = reinterpret_cast<sockaddr_in6&>(storage);
  if (::inet_pton(AF_INET, address.c_str(), &v4.sin_addr) == 1) {
    v4.sin_family = AF_INET;
  } else {
    v6.sin6_family = AF_INET6;
    EXPECT_EQ(::inet_pton(AF_INET6, address.c_str(), &v6.sin6_addr), 1) << address;
  }
  return is_within(reach, reinterpret_cast<sockaddr&>(storage));
}

// Whoever owns a name can let it lead anywhere, also after it was listed.
TEST(Reach, OfANameIsPublicUnlessItsEntrySaysMore) {
  EXPECT_EQ(kTargets.reach_of("https://ris.example.org/hooks/iso"), Reach::kPublic);
  EXPECT_EQ(kTargets.reach_of("https://pacs.hospital.lan/x"), Reach::kPrivate);
  EXPECT_EQ(kTargets.reach_of("http://127.0.0.1:9000/in"), Reach::kAny);
  EXPECT_EQ(kTargets.reach_of("https://elsewhere.example.org/"), std::nullopt);
}

TEST(Reach, TellsPublicFromPrivateAddresses) {
  for (const std::string open :
       {"93.184.216.34", "172.32.0.1", "2606:4700::1111", "::ffff:8.8.8.8"}) {
    EXPECT_TRUE(reaches(Reach::kPublic, open)) << open;
    EXPECT_TRUE(reaches(Reach::kPrivate, open)) << open;
  }
  for (const std::string inside :
       {"10.1.2.3", "172.16.0.1", "172.31.255.255", "192.168.0.1", "127.0.0.1", "100.64.0.1", "::1",
        "fd00::1", "::ffff:10.0.0.1", "64:ff9b::7f00:1", "2002:7f00:1::"}) {
    EXPECT_FALSE(reaches(Reach::kPublic, inside)) << inside;
    EXPECT_TRUE(reaches(Reach::kPrivate, inside)) << inside;
  }
  for (const std::string never :
       {"169.254.169.254", "0.0.0.0", "224.0.0.1", "255.255.255.255", "fe80::1", "ff02::1",
        "::", "::ffff:169.254.169.254", "198.18.0.1"}) {
    EXPECT_FALSE(reaches(Reach::kPublic, never)) << never;
    EXPECT_FALSE(reaches(Reach::kPrivate, never)) << never;
  }
  EXPECT_TRUE(reaches(Reach::kAny, "169.254.169.254"));
}

}  // namespace
}  // namespace isomesh::callbacks
