// Numbers as a person reads them.
#pragma once

#include <cstdint>
#include <string>

namespace isomesh::bench {

std::string fixed(double value, int digits);
std::string grouped(std::uint64_t value);    // 1 707 456
std::string milliseconds(double ms);         // three significant digits, with the unit
std::string mebibytes(std::uint64_t bytes);  // with the unit

}  // namespace isomesh::bench
