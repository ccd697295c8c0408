#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace isomesh::test {

struct GreyPicture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint8_t> pixels;  // row by row
  // Pixels per metre, across and down; 0 if missing.
  std::uint32_t across = 0;
  std::uint32_t down = 0;
};

// Throws std::runtime_error unless the bytes are a complete PNG of one grey channel of 8 bits.
GreyPicture read_png(const std::string& bytes);

}  // namespace isomesh::test
