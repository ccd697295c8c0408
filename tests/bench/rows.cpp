#include "tests/bench/rows.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <sstream>
#include <vector>

namespace isomesh::bench {
namespace {

std::string grouped(std::uint64_t value) {
  std::string digits = std::to_string(value);
  for (std::size_t left = digits.size(); left > 3; left -= 3) digits.insert(left - 3, 1, ' ');
  return digits;
}

// About three digits that tell something.
std::string rounded(double value) {
  const double size = std::abs(value);
  return fixed(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 4);
}

std::string cell(const std::string& name, const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (name.ends_with("ms")) return milliseconds(value.get<double>());
  if (name.ends_with("bytes")) return mebibytes(value.get<std::uint64_t>());
  if (value.is_number_float()) return rounded(value.get<double>());
  return value.is_number_unsigned() ? grouped(value.get<std::uint64_t>()) : value.dump();
}

}  // namespace

std::string to_markdown(const Json& rows) {
  if (rows.empty()) return {};
  std::vector<std::vector<std::string>> lines(1);
  for (const auto& [name, value] : rows.front().items()) lines.front().push_back(name);
  lines.emplace_back(lines.front().size(), "---:");
  lines.back().front() = "---";
  for (const Json& row : rows) {
    lines.emplace_back();
    for (const auto& [name, value] : row.items()) lines.back().push_back(cell(name, value));
  }
  std::ostringstream text;
  for (const auto& line : lines) {
    for (std::size_t column = 0; column < line.size(); ++column) {
      std::size_t width = 0;
      for (const auto& other : lines) width = std::max(width, other.at(column).size());
      text << "| " << (column == 0 ? std::left : std::right) << std::setw(static_cast<int>(width))
           << line[column] << ' ';
    }
    text << "|\n";
  }
  return text.str();
}

std::string fixed(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string milliseconds(double ms) {
  if (ms >= 10'000) return fixed(ms / 1000, 1) + " s";
  if (ms >= 1000) return fixed(ms / 1000, 2) + " s";
  if (ms >= 100) return fixed(ms, 0) + " ms";
  return fixed(ms, ms >= 10 ? 1 : 2) + " ms";
}

std::string mebibytes(std::uint64_t bytes) {
  const double value = static_cast<double>(bytes) / (1 << 20);
  return fixed(value, value < 10 ? 1 : 0) + " MiB";
}

}  // namespace isomesh::bench
