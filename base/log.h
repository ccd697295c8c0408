// The daemon's log: one line per event, on standard error, in one of two forms.
//
// Text:
//   2026-11-20T06:40:00.123Z info request id=4bf9... method=GET status=200
// JSON:
//   {"time":"2026-11-20T06:40:00.123Z","level":"info","event":"request","id":"4bf9...",...}
//
// Values are escaped, so that each is one value on one line. Lines never hold patient data, names
// of uploaded files, queries or tokens; callers ensure this.
#pragma once

#include <array>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

namespace isomesh {

enum class LogFormat { kText, kJson };
enum class LogLevel { kDebug, kInfo, kWarn, kError, kCritical, kOff };

// Nothing is written before. Thread safe: a line that another thread is writing may be in either
// format, and is lost if it was begun before.
void start_log(LogFormat format, LogLevel level);

// One line, written by the destructor; lost if memory is exhausted. Not thread safe, but lines of
// several threads do not mix.
class LogLine {
 public:
  explicit LogLine(std::string_view event, LogLevel level = LogLevel::kInfo);
  ~LogLine();
  LogLine(const LogLine&) = delete;
  LogLine& operator=(const LogLine&) = delete;

  LogLine& add(std::string_view name, std::string_view value);
  LogLine& add(std::string_view name, const char* value) {
    return add(name, std::string_view(value));
  }
  LogLine& add(std::string_view name, std::integral auto value) {
    return add_number(name, static_cast<std::int64_t>(value));
  }
  // With three decimals.
  LogLine& add(std::string_view name, double value);

 private:
  LogLine& add_number(std::string_view name, std::int64_t value);

  LogLevel level_;
  std::string text_;  // empty if the level is not logged
};

// Replaces a {} in a message. Allocates nothing and refers to a text that outlives it.
class LogValue {
 public:
  LogValue(std::string_view text) : text_(text) {}
  LogValue(const std::string& text) : text_(text) {}
  LogValue(const char* text) : text_(text) {}
  LogValue(std::integral auto number) {
    length_ =
        std::to_chars(digits_.data(), digits_.data() + digits_.size(), number).ptr - digits_.data();
  }
  std::string_view text() const {
    return length_ == 0 ? text_
                        : std::string_view(digits_.data(), static_cast<std::size_t>(length_));
  }

 private:
  std::string_view text_;
  std::array<char, 24> digits_ = {};
  std::ptrdiff_t length_ = 0;
};

// Logs an event "message" with one member "text": `text` with each {} replaced by the next of
// `values`. Thread safe. Never throws: the message is lost if memory is exhausted.
void log_message(LogLevel level, std::string_view text,
                 std::initializer_list<LogValue> values) noexcept;

template <typename... Values>
void log_debug(std::string_view text, const Values&... values) {
  log_message(LogLevel::kDebug, text, {LogValue(values)...});
}
template <typename... Values>
void log_info(std::string_view text, const Values&... values) {
  log_message(LogLevel::kInfo, text, {LogValue(values)...});
}
template <typename... Values>
void log_warning(std::string_view text, const Values&... values) {
  log_message(LogLevel::kWarn, text, {LogValue(values)...});
}
template <typename... Values>
void log_error(std::string_view text, const Values&... values) {
  log_message(LogLevel::kError, text, {LogValue(values)...});
}

}  // namespace isomesh
