#include "tests/support/png.h"

#include <cstring>
#include <stdexcept>

#include <png.h>

namespace isomesh::test {
namespace {

// A chunk's length precedes its name, its data follows it.
std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = at; i < at + 4; ++i) {
    number = number << 8 | static_cast<unsigned char>(bytes.at(i));
  }
  return number;
}

}  // namespace

GreyPicture read_png(const std::string& bytes) {
  constexpr std::size_t kDepthAndColour = 24;
  if (bytes.size() < 33 || bytes[kDepthAndColour] != 8 || bytes[kDepthAndColour + 1] != 0) {
    throw std::runtime_error("not a grey PNG of 8 bits");
  }
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0) {
    throw std::runtime_error(static_cast<const char*>(image.message));
  }
  image.format = PNG_FORMAT_GRAY;
  GreyPicture picture = {image.width, image.height, {}, 0, 0};
  picture.pixels.resize(PNG_IMAGE_SIZE(image));
  if (png_image_finish_read(&image, nullptr, picture.pixels.data(), 0, nullptr) == 0) {
    throw std::runtime_error(static_cast<const char*>(image.message));
  }
  if (!bytes.ends_with(std::string("\0\0\0\0IEND\xae\x42\x60\x82", 12))) {
    throw std::runtime_error("the PNG has no end, or something behind it");
  }
  if (const std::size_t name = bytes.find("pHYs"); name != std::string::npos) {
    picture.across = number_at(bytes, name + 4);
    picture.down = number_at(bytes, name + 8);
  }
  return picture;
}

}  // namespace isomesh::test
