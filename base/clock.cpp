#include "base/clock.h"

#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>

namespace isomesh {

std::string utc_text(std::chrono::system_clock::time_point time, const char* format) {
  const std::time_t seconds =
      std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(time));
  std::tm parts = {};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 40> text = {};
  std::strftime(text.data(), text.size(), format, &parts);
  return text.data();
}

std::string timestamp() { return timestamp_of(std::chrono::system_clock::now()); }

std::string timestamp_of(std::chrono::system_clock::time_point now) {
  const auto fraction = std::chrono::duration_cast<std::chrono::milliseconds>(
                            now - std::chrono::floor<std::chrono::seconds>(now))
                            .count();
  std::array<char, 16> tail = {};
  std::snprintf(tail.data(), tail.size(), ".%03dZ", static_cast<int>(fraction % 1000));
  return utc_text(now, "%Y-%m-%dT%H:%M:%S") + tail.data();
}

std::chrono::system_clock::time_point time_of(std::string_view timestamp) {
  std::tm parts = {};
  int milliseconds = 0;
  const std::string copy(timestamp);
  if (std::sscanf(copy.c_str(), "%d-%d-%dT%d:%d:%d.%dZ", &parts.tm_year, &parts.tm_mon,
                  &parts.tm_mday, &parts.tm_hour, &parts.tm_min, &parts.tm_sec,
                  &milliseconds) != 7) {
    return {};
  }
  parts.tm_year -= 1900;
  parts.tm_mon -= 1;
  constexpr std::time_t kYear2262 = 9'214'646'400;
  const std::time_t seconds = ::timegm(&parts);
  if (seconds < 0 || seconds >= kYear2262) return {};
  return std::chrono::system_clock::from_time_t(seconds) + std::chrono::milliseconds(milliseconds);
}

std::string http_date_of(std::chrono::system_clock::time_point time) {
  return utc_text(time, "%a, %d %b %Y %H:%M:%S GMT");
}

}  // namespace isomesh
