// Bytes as text, and their digests.
#include <array>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/base64.h"
#include "base/hex.h"
#include "base/sha256.h"

namespace isomesh {
namespace {

TEST(Sha256, GivesTheKnownDigests) {
  EXPECT_EQ(sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_of(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  const std::string text(1000, 'x');
  for (const std::size_t piece : {1U, 7U, 63U, 64U, 65U, 999U}) {
    Sha256 digest;
    for (std::size_t begin = 0; begin < text.size(); begin += piece) {
      digest.update(std::string_view(text).substr(begin, piece));
    }
    EXPECT_EQ(to_hex(digest.finish()), sha256_of(text)) << piece;
  }
}

TEST(Hex, IsLowerCaseWithBothDigits) {
  const std::vector<std::uint8_t> bytes = {0x00, 0x0f, 0xa0, 0xff};
  EXPECT_EQ(to_hex(bytes), "000fa0ff");
  EXPECT_EQ(to_hex(""), "");
}

TEST(Hex, IsReadBack) {
  std::string bytes;
  for (int byte = 0; byte < 256; ++byte) bytes += static_cast<char>(byte);
  EXPECT_EQ(from_hex(to_hex(bytes)), bytes);
  for (const char* wrong : {"0", "0g", "A0", "0 ", "000"}) EXPECT_FALSE(from_hex(wrong)) << wrong;
}

// The examples of RFC 4648, section 10.
TEST(Base64, IsThatOfTheStandard) {
  EXPECT_EQ(to_base64(""), "");
  EXPECT_EQ(to_base64("f"), "Zg==");
  EXPECT_EQ(to_base64("fo"), "Zm8=");
  EXPECT_EQ(to_base64("foobar"), "Zm9vYmFy");
}

TEST(Base64, IsWrittenWhereItIsToBe) {
  const std::string bytes = "any twelve b";
  std::array<char, 20> text = {};
  char* const end = write_base64(std::as_bytes(std::span(bytes)), text.data());
  EXPECT_EQ(std::string(text.data(), static_cast<std::size_t>(end - text.data())),
            to_base64(bytes));
}

TEST(Base64, IsReadBack) {
  std::string bytes;
  for (int byte = 255; byte >= 0; --byte) {
    bytes += static_cast<char>(byte);
    EXPECT_EQ(from_base64(to_base64(bytes)), bytes);
  }
}

TEST(Base64, RefusesWhatIsNone) {
  for (const char* wrong : {"Z", "Zg", "Zg=", "Z===", "Zg==Zg==", " Zg=", "Zm8\n", "Zm-_"}) {
    EXPECT_FALSE(from_base64(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace isomesh
