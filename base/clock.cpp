#include "base/clock.h"

#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>

namespace isomesh {

std::string timestamp() {
  const auto now = std::chrono::system_clock::now();
  const std::time_t seconds =
      std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(now));
  const auto fraction = std::chrono::duration_cast<std::chrono::milliseconds>(
                            now - std::chrono::floor<std::chrono::seconds>(now))
                            .count();
  std::tm parts = {};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 20> text = {};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::array<char, 16> tail = {};
  std::snprintf(tail.data(), tail.size(), ".%03dZ", static_cast<int>(fraction % 1000));
  return std::string(text.data()) + tail.data();
}

}  // namespace isomesh
