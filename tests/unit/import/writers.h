// Small files in the three formats, written plainly and apart from the importers: every field can
// be set to nonsense.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/support/deflate.h"

namespace isomesh::import::test {

// The bytes of numbers in either byte order.
template <class Number>
std::string bytes_of(const std::vector<Number>& numbers, bool big_endian = false) {
  std::string result;
  for (const Number number : numbers) {
    std::array<char, sizeof(Number)> raw;
    std::memcpy(raw.data(), &number, sizeof(Number));
    if (big_endian) std::reverse(raw.begin(), raw.end());
    result.append(raw.data(), raw.size());
  }
  return result;
}

// Deterministic samples over much of the type's range; finite for floats.
template <class Number>
std::vector<Number> some_samples(std::size_t count) {
  std::vector<Number> result;
  std::uint64_t state = 88172645463325252U;
  for (std::size_t at = 0; at < count; ++at) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    if constexpr (std::is_floating_point_v<Number>) {
      result.push_back(static_cast<Number>(static_cast<std::int64_t>(state) >> 16) / 1024);
    } else {
      result.push_back(static_cast<Number>(state));
    }
  }
  return result;
}

using isomesh::test::bzip2;
using isomesh::test::gzip;
using isomesh::test::zlib;

struct NiftiFields {
  int version = 1;
  bool big_endian = false;
  std::string magic = {};  // empty: that of a single file
  std::vector<std::int64_t> dim = {3, 4, 3, 2, 1, 1, 1, 1};
  int datatype = 2;
  int bitpix = 8;
  std::vector<double> pixdim = {1, 1, 1, 1, 1, 1, 1, 1};
  double vox_offset = -1;  // negative: right behind the header and its extension flags
  double slope = 0;
  double intercept = 0;
  int units = 2;
  int qform_code = 0;
  int sform_code = 1;
  std::vector<double> quaternion = {0, 0, 0};
  std::vector<double> qoffset = {0, 0, 0};
  std::vector<double> srow = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

// The header, its four extension flags and `samples`, which are bytes in the file's byte order.
std::string nifti(const NiftiFields& fields, std::string_view samples);

// The code and the bits of a type of sample.
template <class Number>
std::pair<int, int> nifti_type() {
  constexpr bool kFloat = std::is_floating_point_v<Number>;
  constexpr bool kSigned = std::is_signed_v<Number>;
  constexpr int kBits = sizeof(Number) * 8;
  if constexpr (kFloat) return {kBits == 32 ? 16 : 64, kBits};
  if constexpr (kBits == 8) return {kSigned ? 256 : 2, kBits};
  if constexpr (kBits == 16) return {kSigned ? 4 : 512, kBits};
  if constexpr (kBits == 32) return {kSigned ? 8 : 768, kBits};
  return {kSigned ? 1024 : 1280, kBits};
}

// A header's lines, in order, and what follows them.
using Lines = std::vector<std::pair<std::string, std::string>>;

std::string nrrd(const Lines& lines, std::string_view payload);
std::string metaimage(const Lines& lines, std::string_view payload);

// `lines` with one value set, or one line added (for MetaImage before the last, which must stay
// last), or, for an empty value, taken away.
Lines with(Lines lines, const std::string& name, const std::string& value);

// 4 x 3 x 2 samples of one byte, 1 mm apart.
Lines small_nrrd();
Lines small_metaimage();
inline constexpr std::string_view kSmallSamples = "abcdefghijklmnopqrstuvwx";

}  // namespace isomesh::import::test
