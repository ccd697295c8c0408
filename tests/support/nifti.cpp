#include "tests/support/nifti.h"

#include <cstring>
#include <memory>
#include <stdexcept>

#include <zlib.h>

namespace isomesh::test {
namespace {

// Offsets of the NIfTI-1 header.
constexpr std::size_t kHeaderBytes = 348;
constexpr std::size_t kDimOffset = 40;
constexpr std::size_t kDatatypeOffset = 70;
constexpr std::size_t kDataStartOffset = 108;
constexpr std::int16_t kDatatypeUint8 = 2;

template <class T>
T read_field(const std::vector<std::uint8_t>& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::vector<std::uint8_t> gunzip(const std::filesystem::path& path) {
  const auto close = [](gzFile file) { gzclose(file); };
  const std::unique_ptr<gzFile_s, decltype(close)> file(gzopen(path.c_str(), "rb"), close);
  if (!file) throw std::runtime_error("cannot open " + path.string());
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint8_t> block(1 << 20);
  for (;;) {
    const int count = gzread(file.get(), block.data(), static_cast<unsigned>(block.size()));
    if (count < 0) throw std::runtime_error("cannot unpack " + path.string());
    if (count == 0) return bytes;
    bytes.insert(bytes.end(), block.begin(), block.begin() + count);
  }
}

}  // namespace

SampleVolume<std::uint8_t> read_nifti_samples(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = gunzip(path);
  if (bytes.size() < kHeaderBytes || read_field<std::int32_t>(bytes, 0) != kHeaderBytes ||
      read_field<std::int16_t>(bytes, kDimOffset) != 3 ||
      read_field<std::int16_t>(bytes, kDatatypeOffset) != kDatatypeUint8) {
    throw std::runtime_error(path.string() + " is not a NIfTI-1 volume of uint8");
  }
  const auto extent = [&](std::size_t axis) {
    return static_cast<std::uint32_t>(read_field<std::int16_t>(bytes, kDimOffset + 2 + 2 * axis));
  };
  SampleVolume<std::uint8_t> volume;
  volume.dims = {extent(0), extent(1), extent(2)};
  const auto start = static_cast<std::size_t>(read_field<float>(bytes, kDataStartOffset));
  if (bytes.size() != start + volume.dims.samples()) {
    throw std::runtime_error(path.string() + " does not have the samples that it announces");
  }
  volume.samples.assign(bytes.begin() + static_cast<std::ptrdiff_t>(start), bytes.end());
  return volume;
}

}  // namespace isomesh::test
