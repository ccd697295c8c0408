#include "tests/bench/rows.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <vector>

#include "tests/bench/numbers.h"

namespace isomesh::bench {
namespace {

std::string cell(const std::string& name, const Json& value) {
  if (value.is_null()) return "-";
  if (value.is_string()) return value.get<std::string>();
  if (name.ends_with("_ms")) return milliseconds(value.get<double>());
  if (value.is_number_unsigned()) return grouped(value.get<std::uint64_t>());
  return value.is_number_float() ? fixed(value.get<double>(), 4) : value.dump();
}

}  // namespace

std::string to_text(const Json& rows) {
  if (rows.empty()) return {};
  std::vector<std::vector<std::string>> lines(1);
  for (const auto& [name, value] : rows.front().items()) lines.front().push_back(name);
  for (const Json& row : rows) {
    lines.emplace_back();
    for (const auto& [name, value] : row.items()) lines.back().push_back(cell(name, value));
  }
  std::ostringstream text;
  for (const auto& line : lines) {
    for (std::size_t column = 0; column < line.size(); ++column) {
      std::size_t width = 0;
      for (const auto& other : lines) width = std::max(width, other.at(column).size());
      text << (column == 0 ? std::left : std::right) << std::setw(static_cast<int>(width) + 2)
           << line[column];
    }
    text << '\n';
  }
  return text.str();
}

}  // namespace isomesh::bench
