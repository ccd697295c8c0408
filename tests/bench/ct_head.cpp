#include "tests/bench/ct_head.h"

#include <array>
#include <charconv>
#include <cstring>
#include <memory>
#include <stdexcept>

#include <zlib.h>

namespace isomesh::bench {
namespace {

constexpr std::size_t kTarBlock = 512;

// A gzipped tar, read from its beginning to its end.
class TarReader {
 public:
  explicit TarReader(const std::filesystem::path& path)
      : name_(path.string()), file_(gzopen(name_.c_str(), "rb"), &gzclose) {
    if (!file_) fail("cannot be opened");
  }

  // Goes to the next member; its path without the folder, empty at the end.
  std::string next() {
    skip(padded(left_));
    std::array<char, kTarBlock> header;
    read(header.data(), header.size());
    if (header[0] == 0) return {};
    constexpr std::size_t kSizeField = 124;
    const char* size = header.data() + kSizeField;
    if (std::from_chars(size, size + 11, left_, 8).ec != std::errc()) fail("is not a tar");
    const std::string path(header.data(), strnlen(header.data(), 100));
    return path.substr(path.rfind('/') + 1);
  }

  std::vector<std::byte> content() {
    std::vector<std::byte> bytes(left_);
    read(bytes.data(), bytes.size());
    skip(padded(left_) - left_);
    left_ = 0;
    return bytes;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(name_ + " " + what);
  }

 private:
  static std::size_t padded(std::size_t bytes) {
    return (bytes + kTarBlock - 1) / kTarBlock * kTarBlock;
  }

  void read(void* target, std::size_t bytes) {
    if (gzfread(target, 1, bytes, file_.get()) != bytes) fail("ends early");
  }

  // Forward only: gzseek inflates what it passes.
  void skip(std::size_t bytes) {
    if (bytes > 0 && gzseek(file_.get(), static_cast<z_off_t>(bytes), SEEK_CUR) < 0) {
      fail("ends early");
    }
  }

  std::string name_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> file_;
  std::size_t left_ = 0;
};

// The three numbers of the array that follows a key of a property list.
std::array<double, 3> array_of(const TarReader& tar, const std::string& plist,
                               const std::string& key) {
  std::size_t place = plist.find("<key>" + key + "</key>");
  std::array<double, 3> values;
  for (double& value : values) {
    place = std::min(plist.find("<integer>", place), plist.find("<real>", place));
    if (place == std::string::npos) tar.fail("does not tell its " + key);
    const char* number = plist.data() + plist.find('>', place) + 1;
    if (std::from_chars(number, plist.data() + plist.size(), value).ec != std::errc()) {
      tar.fail("does not tell its " + key);
    }
    ++place;
  }
  return values;
}

}  // namespace

Samples read_inv3(const std::filesystem::path& path) {
  TarReader tar(path);
  Samples samples;
  samples.name = "ct-head";
  samples.type = SampleType::kInt16;
  std::string plist;
  for (std::string member = tar.next(); !member.empty(); member = tar.next()) {
    if (member == "main.plist") {
      const auto bytes = tar.content();
      plist.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    } else if (member == "matrix.dat") {
      samples.bytes = tar.content();
    }
  }
  const auto shape = array_of(tar, plist, "shape");  // z, y, x
  samples.geometry.spacing = array_of(tar, plist, "spacing");
  samples.dims = {static_cast<std::uint32_t>(shape[2]), static_cast<std::uint32_t>(shape[1]),
                  static_cast<std::uint32_t>(shape[0])};
  if (plist.find("<string>int16</string>") == std::string::npos ||
      samples.bytes.size() != samples.dims.samples() * sizeof(std::int16_t)) {
    tar.fail("does not hold the samples that it describes");
  }
  return samples;
}

}  // namespace isomesh::bench
