// The page at /, in builds with and without it. What is in it is tested in tests/web.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json_text.h"
#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;
using testing::StartsWith;

class PageTest : public testing::Test {
 protected:
  Daemon daemon_;
};

TEST_F(PageTest, IsServedWithAPolicyThatAllowsNothingFromElsewhere) {
  const Answer answer = daemon_.get("/");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(answer.header("x-content-type-options"), "nosniff");
  EXPECT_THAT(answer.body, StartsWith("<!doctype html>"));
  const std::string policy = answer.header("content-security-policy");
  EXPECT_THAT(policy, StartsWith("default-src 'none';"));
  EXPECT_THAT(policy, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(policy, Not(HasSubstr("unsafe-inline")));
  EXPECT_THAT(policy, Not(HasSubstr("http")));
}

// RFC 9110, 6.6.1: caches and clients reckon ages by it.
TEST_F(PageTest, AndEveryOtherResponseSaysTheTime) {
  for (const std::string path : {"/", "/v1/volumes", "/nothing", "/v1/volumes?limit=x"}) {
    EXPECT_THAT(daemon_.get(path).header("date"), MatchesRegex("[A-Z][a-z]{2}, [0-9]{2} .* GMT"))
        << path;
  }
}

TEST_F(PageTest, IsAskedForAgainAndNotSentAgain) {
  const Answer answer = daemon_.get("/");
  EXPECT_EQ(answer.header("cache-control"), "no-cache");
  const Answer again = daemon_.get("/", {{"If-None-Match", answer.header("etag")}});
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
  EXPECT_EQ(again.header("etag"), answer.header("etag"));
}

TEST_F(PageTest, AndTheClientIsAModuleOfThisVersion) {
  const Answer answer = daemon_.get("/client.js");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "text/javascript; charset=utf-8");
  EXPECT_EQ(daemon_.get("/client.js", {{"If-None-Match", answer.header("etag")}}).status, 304);
  if (answer.header("etag") == "\"missing\"") {
    EXPECT_THAT(answer.body, StartsWith("throw new Error('This isomeshd was built without"));
    return;
  }
  const std::string version = parse_json<nlohmann::json>(daemon_.get("/version").body)["version"];
  EXPECT_THAT(answer.body, StartsWith("/*! isomesh " + version + ": "));
  EXPECT_THAT(answer.body, HasSubstr("\nexport {"));
  EXPECT_THAT(answer.body, Not(HasSubstr("\nimport ")));
}

TEST_F(PageTest, HasNothingBesideItsFiles) {
  for (const std::string path :
       {"/assets/nothing.js", "/assets/", "/assets/../page.bin", "/index.html"}) {
    EXPECT_EQ(daemon_.get(path).status, 404) << path;
  }
  EXPECT_EQ(daemon_.send("POST", "/", "x").status, 405);
}

}  // namespace
}  // namespace isomesh
