#include "server/hospital/objects/uid.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include <openssl/evp.h>

#include "base/error.h"

namespace isomesh::dicom {
namespace {

constexpr std::size_t kUuidBytes = 16;
constexpr std::size_t kSha1Bytes = 20;

// 83c05459-1f3d-464d-b89f-b74feb95803f, randomly chosen once.
constexpr std::array<std::uint8_t, kUuidBytes> kNamespace = {
    0x83, 0xc0, 0x54, 0x59, 0x1f, 0x3d, 0x46, 0x4d, 0xb8, 0x9f, 0xb7, 0x4f, 0xeb, 0x95, 0x80, 0x3f};

// A 128-bit number, most significant byte first, in decimal.
std::string decimal(std::array<std::uint8_t, kUuidBytes> number) {
  std::string digits;
  while (std::ranges::any_of(number, [](std::uint8_t byte) { return byte != 0; })) {
    unsigned rest = 0;
    for (std::uint8_t& byte : number) {
      const unsigned dividend = rest * 256 + byte;
      byte = static_cast<std::uint8_t>(dividend / 10);
      rest = dividend % 10;
    }
    digits += static_cast<char>('0' + rest);
  }
  std::ranges::reverse(digits);
  return digits;
}

}  // namespace

std::string name_based_uid(std::string_view name) {
  std::string text(kNamespace.begin(), kNamespace.end());
  text += name;
  std::array<std::uint8_t, kSha1Bytes> digest = {};
  unsigned length = 0;
  if (EVP_Digest(text.data(), text.size(), digest.data(), &length, EVP_sha1(), nullptr) != 1 ||
      length != kSha1Bytes) {
    throw Error(ErrorCode::kInternal, "SHA-1 cannot be computed");
  }
  std::array<std::uint8_t, kUuidBytes> uuid = {};
  std::copy_n(digest.begin(), kUuidBytes, uuid.begin());
  uuid[6] = static_cast<std::uint8_t>((uuid[6] & 0x0f) | 0x50);  // version 5
  uuid[8] = static_cast<std::uint8_t>((uuid[8] & 0x3f) | 0x80);  // RFC 9562's variant
  return "2.25." + decimal(uuid);
}

}  // namespace isomesh::dicom
