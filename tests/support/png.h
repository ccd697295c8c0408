#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace isomesh::test {

struct GreyPicture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint8_t> pixels;  // row by row
  // Pixels a metre, across and down; 0 where the file does not say it.
  std::uint32_t across = 0;
  std::uint32_t down = 0;
};

// Throws std::runtime_error when the bytes are not a whole PNG of one grey channel of 8 bits.
GreyPicture read_png(const std::string& bytes);

}  // namespace isomesh::test
