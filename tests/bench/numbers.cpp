#include "tests/bench/numbers.h"

#include <cstdio>

namespace isomesh::bench {

std::string fixed(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string grouped(std::uint64_t value) {
  std::string digits = std::to_string(value);
  for (std::size_t left = digits.size(); left > 3; left -= 3) digits.insert(left - 3, 1, ' ');
  return digits;
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
