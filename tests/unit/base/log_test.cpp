#include "base/log.h"

#include <algorithm>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace isomesh::http {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::MatchesRegex;

class LogTest : public testing::Test {
 protected:
  ~LogTest() override { start_log(LogFormat::kText, LogLevel::kOff); }

  static std::string logged(LogFormat format, LogLevel level, const std::function<void()>& run) {
    start_log(format, level);
    testing::internal::CaptureStderr();
    run();
    return testing::internal::GetCapturedStderr();
  }

  // Bytes that a hostile client might send.
  const std::string hostile_ = "a\"b=c\nd\r\x1b[2Je \\ \xff\xe2\x80\xae";
};

TEST_F(LogTest, ALineOfTextHasItsMembersInOrder) {
  const std::string line = logged(LogFormat::kText, LogLevel::kInfo, [] {
    LogLine("request").add("method", "GET").add("status", 200).add("ms", 0.25).add("none", "");
  });
  EXPECT_THAT(line, MatchesRegex("[-0-9]{10}T[:0-9]{8}\\.[0-9]{3}Z info request method=GET "
                                 "status=200 ms=0.250 none=\"\"\n"));
}

TEST_F(LogTest, ALineOfJsonIsOneObject) {
  const json line = json::parse(logged(LogFormat::kJson, LogLevel::kInfo, [] {
    LogLine("request", LogLevel::kWarn).add("method", "GET").add("status", 200).add("ms", 0.25);
  }));
  EXPECT_EQ(line["event"], "request");
  EXPECT_EQ(line["level"], "warning");
  EXPECT_EQ(line["method"], "GET");
  EXPECT_EQ(line["status"], 200);
  EXPECT_EQ(line["ms"], 0.25);
}

TEST_F(LogTest, NoValueBreaksOutOfItsPlace) {
  const auto write = [&] {
    LogLine("event").add("name", hostile_).add("next", 1);
    log_error("said {}", hostile_);
  };
  const std::string text = logged(LogFormat::kText, LogLevel::kInfo, write);
  EXPECT_EQ(std::ranges::count(text, '\n'), 2);
  EXPECT_TRUE(std::ranges::all_of(
      text, [](unsigned char c) { return c == '\n' || (c >= ' ' && c < 0x7F); }));
  EXPECT_THAT(text, HasSubstr("name=\"a\\\"b=c\\nd\\r\\u001b[2Je \\\\ "));
  const std::string lines = logged(LogFormat::kJson, LogLevel::kInfo, write);
  const std::size_t end = lines.find('\n');
  const json event = json::parse(lines.substr(0, end));
  EXPECT_THAT(event["name"].get<std::string>(), testing::StartsWith("a\"b=c\nd\r"));
  EXPECT_EQ(event["next"], 1);
  EXPECT_THAT(json::parse(lines.substr(end))["text"].get<std::string>(),
              testing::StartsWith("said a\"b=c\nd\r"));
}

TEST_F(LogTest, AMessageTakesItsValuesInTheirOrder) {
  const std::string text = logged(LogFormat::kText, LogLevel::kInfo, [] {
    log_warning("{} of {} {} are late", 3, std::uint64_t{18446744073709551615U},
                std::string("trains {}"));
    log_info("no place", "for a value");
    log_info("{} {}", -1);
  });
  EXPECT_THAT(text,
              HasSubstr("warning message text=\"3 of 18446744073709551615 trains {} are late\""));
  EXPECT_THAT(text, HasSubstr("info message text=\"no place\""));
  EXPECT_THAT(text, HasSubstr("text=\"-1 {}\""));
}

TEST_F(LogTest, WhatIsBelowTheLevelIsNotWritten) {
  EXPECT_EQ(logged(LogFormat::kText, LogLevel::kWarn, [] { LogLine("request").add("a", 1); }), "");
  EXPECT_EQ(
      logged(LogFormat::kText, LogLevel::kOff, [] { log_message(LogLevel::kCritical, "end", {}); }),
      "");
}

}  // namespace
}  // namespace isomesh::http
