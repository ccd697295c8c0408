#include "base/log.h"

#include <array>
#include <atomic>
#include <cstdio>
#include <new>
#include <string>

#include <nlohmann/json.hpp>

#include "base/clock.h"

namespace isomesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 5> kLevelNames = {"debug", "info", "warning", "error",
                                                    "critical"};

std::atomic<LogFormat> chosen_format = LogFormat::kText;
std::atomic<LogLevel> lowest_level = LogLevel::kOff;

std::string quoted(std::string_view text) {
  // Only ASCII: other characters can reverse or hide a line on a terminal.
  return Json(text).dump(-1, ' ', true, Json::error_handler_t::replace);
}

bool is_plain(std::string_view text) {
  for (const unsigned char c : text) {
    if (c <= ' ' || c >= 0x7F || c == '"' || c == '=' || c == '\\') return false;
  }
  return !text.empty();
}

std::string member(std::string_view name, std::string_view written) {
  return chosen_format == LogFormat::kJson ? ',' + quoted(name) + ':' + std::string(written)
                                           : ' ' + std::string(name) + '=' + std::string(written);
}

std::string text_member(std::string_view name, std::string_view value) {
  const bool bare = chosen_format == LogFormat::kText && is_plain(value);
  return member(name, bare ? std::string(value) : quoted(value));
}

std::string event_member(std::string_view name) {
  return chosen_format == LogFormat::kJson ? ",\"event\":" + quoted(name) : ' ' + std::string(name);
}

bool is_logged(LogLevel level) { return level >= lowest_level && level != LogLevel::kOff; }

}  // namespace

void start_log(LogFormat format, LogLevel level) {
  chosen_format = format;
  lowest_level = level;
}

LogLine::LogLine(std::string_view event, LogLevel level) : level_(level) {
  if (is_logged(level)) text_ = event_member(event);
}

LogLine::~LogLine() {
  if (text_.empty()) return;
  try {
    const std::string level = kLevelNames.at(static_cast<std::size_t>(level_));
    const std::string line =
        chosen_format == LogFormat::kJson
            ? "{\"time\":\"" + timestamp() + "\",\"level\":\"" + level + '"' + text_ + "}\n"
            : timestamp() + ' ' + level + text_ + '\n';
    std::fwrite(line.data(), 1, line.size(),
                stderr);  // stderr is unbuffered: one call writes the whole line
  } catch (const std::bad_alloc&) {
    // Without memory the line is lost, but its request is served.
  }
}

LogLine& LogLine::add(std::string_view name, std::string_view value) {
  if (!text_.empty()) text_ += text_member(name, value);
  return *this;
}

LogLine& LogLine::add_number(std::string_view name, std::int64_t value) {
  if (!text_.empty()) text_ += member(name, std::to_string(value));
  return *this;
}

LogLine& LogLine::add(std::string_view name, double value) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  if (!text_.empty()) text_ += member(name, text.data());
  return *this;
}

void log_message(LogLevel level, std::string_view text,
                 std::initializer_list<LogValue> values) noexcept {
  if (!is_logged(level)) return;
  try {
    std::string message;
    for (const LogValue& value : values) {
      const std::size_t place = text.find("{}");
      if (place == std::string_view::npos) break;
      message.append(text.substr(0, place)).append(value.text());
      text.remove_prefix(place + 2);
    }
    LogLine("message", level).add("text", message.append(text));
  } catch (const std::bad_alloc&) {
    // As in LogLine.
  }
}

}  // namespace isomesh
