// The daemon's log: one line an event, on standard error, in one of two forms.
//
// As text:
//   2026-11-20T06:40:00.123Z info request id=4bf9... method=GET status=200
// As JSON:
//   {"time":"2026-11-20T06:40:00.123Z","level":"info","event":"request","id":"4bf9...",...}
//
// Whatever a value holds, it stays one value on one line. Lines never hold patient data, names of
// uploaded files, queries or tokens: callers see to that.
#pragma once

#include <concepts>
#include <cstdint>
#include <memory>
#include <string_view>

namespace isomesh {

enum class LogFormat { kText, kJson };
enum class LogLevel { kDebug, kInfo, kWarn, kError, kOff };

// To be called before threads start; without it LogLine writes nothing. spdlog's own calls
// (spdlog::error and the like) take the same form afterwards: an event "message" with one member
// "text".
void start_log(LogFormat format, LogLevel level);

// One line, written when it goes. Not thread safe; lines of several threads do not mix.
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
  // With three digits behind the point.
  LogLine& add(std::string_view name, double value);

 private:
  LogLine& add_number(std::string_view name, std::int64_t value);

  struct State;
  std::unique_ptr<State> state_;  // null when the level is not logged
};

}  // namespace isomesh
