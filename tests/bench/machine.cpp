#include "tests/bench/machine.h"

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <draco/core/draco_version.h>
#include <sys/utsname.h>

#include "tests/bench/peers.h"

namespace isomesh::bench {
namespace {

// The value of the first line of a file that begins with `key`, without separators and quotes.
std::string value_in(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t begin = line.find_first_not_of(" \t:=\"", key.size());
    const std::size_t end = line.find_last_not_of(" \t\"");
    if (begin <= end && begin != std::string::npos) return line.substr(begin, end + 1 - begin);
  }
  return "unknown";
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  return text;
}

std::string memory() {
  const std::string kibibytes = value_in("/proc/meminfo", "MemTotal");
  return mebibytes(std::strtoull(kibibytes.c_str(), nullptr, 10) << 10);
}

std::string kernel() {
  utsname name;
  return uname(&name) == 0 ? std::string(name.sysname) + ' ' + name.release : "unknown";
}

// The load of the last minute; negative if it is unknown.
double load_average() {
  double average = 0;
  return getloadavg(&average, 1) == 1 ? average : -1;
}

std::string load() {
  const double average = load_average();
  return average >= 0 ? fixed(average, 1) + " before the run" : "unknown";
}

int processors() { return static_cast<int>(std::max(1U, std::thread::hardware_concurrency())); }

}  // namespace

void warn_when_busy() {
  constexpr double kQuiet = 0.7;
  if (load_average() <= kQuiet) return;
  std::cerr << "isomesh-bench: the machine is busy (load " << fixed(load_average(), 1) << " on "
            << processors() << " cores); these figures will be too bad\n";
}

Json describe_machine() {
  const std::vector<std::pair<const char*, std::string>> facts = {
      {"processor", value_in("/proc/cpuinfo", "model name")},
      {"cores", std::to_string(processors())},
      {"memory", memory()},
      {"system", value_in("/etc/os-release", "PRETTY_NAME") + ", " + kernel()},
      {"compiler", std::string(ISOMESH_COMPILER) + ", " + ISOMESH_BUILD_TYPE},
      {"isomesh", ISOMESH_VERSION},
      {"Draco", draco::kDracoVersion},
      {"peers", peers_description()},
      {"load", load()},
      {"date", today()},
  };
  Json rows = Json::array();
  for (const auto& [name, value] : facts) rows.push_back({{"machine", name}, {"", value}});
  return rows;
}

}  // namespace isomesh::bench
