#include "base/clock.h"

#include <algorithm>
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

std::optional<std::chrono::system_clock::time_point> nearest_time_of(std::string_view timestamp) {
  using namespace std::chrono;
  constexpr std::string_view kForm = "0000-00-00T00:00:00.000Z";
  const auto has_form = [](char form, char c) {
    return form == '0' ? c >= '0' && c <= '9' : c == form;
  };
  if (!std::ranges::equal(kForm, timestamp, has_form)) return std::nullopt;
  const auto number = [&](std::size_t begin, std::size_t digits) {
    int value = 0;
    for (const char c : timestamp.substr(begin, digits)) value = 10 * value + (c - '0');
    return value;
  };
  const year_month_day date(year(number(0, 4)), month(static_cast<unsigned>(number(5, 2))),
                            day(static_cast<unsigned>(number(8, 2))));
  const hours hour(number(11, 2));
  const minutes minute(number(14, 2));
  const seconds second(number(17, 2));
  if (!date.ok() || hour >= hours(24) || minute >= minutes(60) || second >= seconds(60)) {
    return std::nullopt;
  }
  constexpr sys_days kEnd = sys_days(year(2262) / January / 1);
  if (sys_days(date) >= kEnd) return kEnd - milliseconds(1);
  if (date.year() < year(1970)) return system_clock::time_point();
  return sys_days(date) + hour + minute + second + milliseconds(number(20, 3));
}

std::string http_date_of(std::chrono::system_clock::time_point time) {
  return utc_text(time, "%a, %d %b %Y %H:%M:%S GMT");
}

}  // namespace isomesh
