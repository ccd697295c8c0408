#include "server/http/requests/request_values.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "tests/support/errors.h"
#include "tests/unit/http/requests.h"

namespace isomesh::http {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;
using test::error_of;
using test::fields_of;
using test::thrown_by;
using test::with_query;
using testing::ElementsAre;
using testing::UnorderedElementsAre;

Request with_header(const std::string& name, const std::string& value) {
  Request request;
  request.headers.emplace_back(name, value);
  return request;
}

TEST(AcceptsGzip, IsWhatTheHeaderSays) {
  for (const std::string header : {"gzip", "gzip, deflate, br", "br;q=1.0, gzip;q=0.5", "*"}) {
    EXPECT_TRUE(accepts_gzip(with_header("Accept-Encoding", header))) << header;
  }
  for (const std::string header : {"", "identity", "br", "gzip;q=0", "gzip; q=0.0", "gzipped"}) {
    EXPECT_FALSE(accepts_gzip(with_header("Accept-Encoding", header))) << header;
  }
  EXPECT_FALSE(accepts_gzip(Request()));
}

// --- Times

TEST(Instant, OutsideOfTheClockIsTheNearestThatItHas) {
  const auto instant = [](const std::string& text) {
    return timestamp_of(instant_of(with_query({{"until", text}}), "until").value());
  };
  EXPECT_EQ(instant("2026-11-20"), "2026-11-20T00:00:00.000Z");
  EXPECT_EQ(instant("2024-02-29T23:59:59Z"), "2024-02-29T23:59:59.000Z");
  EXPECT_EQ(instant("2261-12-31T23:59:59.999Z"), "2261-12-31T23:59:59.999Z");
  EXPECT_EQ(instant("1970-01-01"), "1970-01-01T00:00:00.000Z");
  for (const char* late : {"2262-01-01", "2300-02-28T12:00:00Z", "9999-12-31"}) {
    EXPECT_EQ(instant(late), "2261-12-31T23:59:59.999Z") << late;
  }
  for (const char* early : {"1969-12-31T23:59:59Z", "1900-01-01", "0001-01-01"}) {
    EXPECT_EQ(instant(early), "1970-01-01T00:00:00.000Z") << early;
  }
}

TEST(Instant, IsATimeThatThereIs) {
  for (const char* wrong :
       {"", "yesterday", "2026-02-30", "2023-02-29", "9999-13-01", "9999-12-32", "2026-00-10",
        "2026-11-20T24:00:00Z", "2026-11-20T12:60:00Z", "2026-11-20T12:00:60Z",
        "2026-11-20T07:30:00", "2026-11-20 07:30:00Z", "2026-11-20T07:30:00+01:00", "+026-11-20"}) {
    EXPECT_EQ(code_thrown_by([&] {
                instant_of(with_query({{"until", wrong}}), "until");
              }),
              ErrorCode::kInvalidParameter)
        << wrong;
  }
}

// --- Waiting

TEST(Wait, IsNoneWithoutAWish) { EXPECT_EQ(wait_of(Request()), milliseconds(0)); }

TEST(Wait, TakesTheQuery) {
  const auto wait = [](const std::string& value) { return wait_of(with_query({{"wait", value}})); };
  EXPECT_EQ(wait("0"), milliseconds(0));
  EXPECT_EQ(wait("10"), milliseconds(10'000));
  EXPECT_EQ(wait("0.25"), milliseconds(250));
  EXPECT_EQ(wait("30"), milliseconds(30'000));
  EXPECT_EQ(wait("31"), milliseconds(30'000));
  EXPECT_EQ(wait("1e300"), milliseconds(30'000));
}

TEST(Wait, TakesThePreference) {
  const auto wait = [](const std::string& value) { return wait_of(with_header("Prefer", value)); };
  EXPECT_EQ(wait("wait=10"), milliseconds(10'000));
  EXPECT_EQ(wait("respond-async, wait=10"), milliseconds(10'000));
  EXPECT_EQ(wait("wait=10, handling=lenient"), milliseconds(10'000));
  EXPECT_EQ(wait("wait=\"10\""), milliseconds(10'000));
  EXPECT_EQ(wait("wait = \"10\"; x=y"), milliseconds(10'000));
  EXPECT_EQ(wait("wait=1000"), milliseconds(30'000));
  EXPECT_EQ(wait("Wait = 10; x=y"), milliseconds(10'000));
}

TEST(Wait, IgnoresOtherPreferences) {
  for (const std::string value : {"", "await=5", "respond-async", "handling=strict; wait=5"}) {
    EXPECT_EQ(wait_of(with_header("Prefer", value)), milliseconds(0)) << value;
  }
}

TEST(Wait, TheQueryGoesBeforeThePreference) {
  Request request = with_header("Prefer", "wait=20");
  request.query.emplace_back("wait", "1");
  EXPECT_EQ(wait_of(request), milliseconds(1'000));
}

// --- Digests

// The digest of "hello".
constexpr const char* kHex = "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824";
const std::string kBase64 = "LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOLmCQ=";

std::optional<std::string> digest(const std::string& header) {
  return sha256_of_content_digest(with_header("Content-Digest", header));
}

TEST(ContentDigest, GivesTheSha256AsHex) {
  EXPECT_EQ(digest("sha-256=:" + kBase64 + ":"), kHex);
  EXPECT_EQ(digest("sha-512=:AAAA:, sha-256=:" + kBase64 + ":"), kHex);
  EXPECT_EQ(digest("sha-256=:" + kBase64 + ":,sha-512=:AAAA:"), kHex);
}

TEST(ContentDigest, OtherAlgorithmsAreIgnored) {
  EXPECT_EQ(sha256_of_content_digest(Request()), std::nullopt);
  EXPECT_EQ(digest("sha-512=:AAAA:"), std::nullopt);
}

TEST(ContentDigest, IsWrittenAsItIsRead) {
  EXPECT_EQ(digest_header(kHex), "sha-256=:" + kBase64 + ":");
}

TEST(ContentDigest, GarbageIsRefused) {
  const std::string one = "sha-256=:" + kBase64 + ":";
  for (const std::string& value :
       {std::string(), std::string("garbage"), one + ",", one + ", " + one,
        std::string("sha-512=AAAA"), std::string("sha-512=:A A:")}) {
    const Error error = error_of([&] { digest(value); }, value);
    EXPECT_THAT(fields_of(error), ElementsAre("Content-Digest"));
  }
}

TEST(ContentDigest, WhatIsNoDigestIsRefused) {
  const std::string thirty_three_bytes = kBase64.substr(0, 43) + "A";
  for (const std::string& value :
       {std::string(), std::string(":"), std::string("::"), kBase64, ":" + kBase64, kBase64 + ":",
        ":" + kBase64.substr(4) + ":", ":" + kBase64 + "AAAA:", ":" + thirty_three_bytes + ":",
        ":" + std::string(44, '!') + ":", ":" + std::string(44, '=') + ":",
        ":" + kBase64.substr(0, 42) + "==:", ":" + std::string(44, '\xff') + ":"}) {
    const Error error = error_of([&] { digest("sha-256=" + value); }, value);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(fields_of(error), ElementsAre("Content-Digest"));
  }
}

// --- Queries and entity tags

TEST(CheckKnown, TakesWhatIsKnown) {
  check_known(with_query({}), {});
  check_known(with_query({{"a", "1"}}), {"a", "b"});
}

TEST(CheckKnown, NamesAllThatIsNot) {
  const Error error = error_of([] {
    check_known(with_query({{"a", "1"}, {"x", "2"}, {"y", "3"}}), {"a"});
  });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(fields_of(error), UnorderedElementsAre("x", "y"));
}

TEST(CheckKnown, RefusesWhatIsGivenTwice) {
  const Error error = error_of([] { check_known(with_query({{"a", "1"}, {"a", "1"}}), {"a"}); });
  EXPECT_THAT(fields_of(error), testing::Each("a"));
}

TEST(CheckKnown, ShowsControlCharactersOfNames) {
  const Error error = error_of([] { check_known(with_query({{std::string("a\0b", 3), ""}}), {}); });
  EXPECT_THAT(fields_of(error), ElementsAre("a\uFFFDb"));
  EXPECT_STREQ(error.what(), "a\uFFFDb: is not a parameter of this request");
}

TEST(CheckKnown, DoesNotRepeatLongNamesWhole) {
  const Error error = error_of([] { check_known(with_query({{std::string(4000, 'x'), ""}}), {}); });
  EXPECT_LT(std::string(error.what()).size(), 200U);
}

// --- Preconditions, cursors, streams

TEST(IfMatch, RefusesWhatIsNotThere) {
  check_if_match(Request(), "\"a\"");
  check_if_match(with_header("If-Match", "*"), "\"a\"");
  check_if_match(with_header("If-Match", "\"b\", \"a\""), "\"a\"");
  // A weak tag is not compared strongly (RFC 9110, 13.1.1).
  for (const std::string other : {"\"b\"", "W/\"a\"", "W/\"a\", \"b\""}) {
    EXPECT_EQ(code_thrown_by([&] { check_if_match(with_header("If-Match", other), "\"a\""); }),
              ErrorCode::kPreconditionFailed)
        << other;
  }
}

TEST(Cursor, StandsForTheRestOfItsList) {
  const std::string id = "018f3c5e-7a60-7c31-a1f2-0f6c2a9be0d4";
  const std::string cursor = cursor_after("jobs", id);
  EXPECT_EQ(id_after(with_query({{"cursor", cursor}}), "jobs"), id);
  EXPECT_EQ(id_after(Request(), "jobs"), "");
  for (const std::string& wrong :
       {std::string(), id, cursor + "0", cursor + "00", cursor.substr(2), std::string("zz"),
        cursor_after("volumes", id), cursor_after("jobs", ""), cursor_after("jobs", "a\nb"),
        cursor_after("jobs", std::string(200, 'a'))}) {
    const Error error = error_of([&] { id_after(with_query({{"cursor", wrong}}), "jobs"); }, wrong);
    EXPECT_THAT(fields_of(error), ElementsAre("cursor"));
  }
}

TEST(LastEventId, IsANumber) {
  EXPECT_EQ(last_event_id(Request()), std::nullopt);
  EXPECT_EQ(last_event_id(with_header("Last-Event-ID", "17")), 17U);
  for (const std::string wrong : {"", "-1", "x", "1 2", "18446744073709551616"}) {
    EXPECT_TRUE(thrown_by([&] { last_event_id(with_header("Last-Event-ID", wrong)); })) << wrong;
  }
}

// Weights of text/plain in version 0.0.4, and of application/openmetrics-text in version 1.0.0.
TEST(Accept, WeighsMediaTypesByTheMostSpecificRange) {
  const std::vector<std::tuple<std::string, double, double>> cases = {
      {"", 0, 0},
      {"*/*", 1, 1},
      {"text/html, application/xhtml+xml, */*;q=0.8", 0.8, 0.8},
      {"text/plain", 1, 0},
      {"TEXT/Plain; Version=\"0.0.4\"; Q=0.5", 0.5, 0},
      {"text/*", 1, 0},
      {"application/*;q=0.1, */*", 1, 0.1},
      {"text/plain;version=0.0.3", 0, 0},
      {"text/plain;q=0, */*", 0, 1},
      {"text/plain;version=0.0.4;q=0.2, text/plain;q=0.9", 0.2, 0},
      {"text/plain;q=none", 0, 0},
      {"text/plain;q=+1", 0, 0},
      {"text", 0, 0},
      {"application/openmetrics-text", 0, 1},
      {"application/openmetrics-text; version=0.0.1", 0, 0},
      // Prometheus 2.42 and 3.0.
      {"application/openmetrics-text;version=1.0.0,application/"
       "openmetrics-text;version=0.0.1;q=0.75,"
       "text/plain;version=0.0.4;q=0.5,*/*;q=0.1",
       0.5, 1},
      {"application/openmetrics-text;version=1.0.0;escaping=allow-utf-8;q=0.5,"
       "application/openmetrics-text;version=0.0.1;q=0.4,"
       "text/plain;version=1.0.0;escaping=allow-utf-8;q=0.3,text/plain;version=0.0.4;q=0.2,"
       "*/*;q=0.1",
       0.2, 0.5}};
  for (const auto& [accept, plain, open] : cases) {
    Request request;
    if (!accept.empty()) request.headers.emplace_back("Accept", accept);
    EXPECT_EQ(accepted_weight(request, "text/plain", "0.0.4"), plain) << accept;
    EXPECT_EQ(accepted_weight(request, "application/openmetrics-text", "1.0.0"), open) << accept;
  }
}

}  // namespace
}  // namespace isomesh::http
