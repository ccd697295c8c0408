#include "server/net/chunk_scanner.h"

#include <string>

#include <gtest/gtest.h>

namespace isomesh::net {
namespace {

// Byte by byte, and at once, which must agree.
bool is_body(const std::string& bytes, bool is_over) {
  ChunkScanner whole;
  const bool fits = whole.scan(bytes);
  ChunkScanner slow;
  bool fits_slowly = true;
  for (const char c : bytes) fits_slowly = slow.scan({&c, 1});
  EXPECT_EQ(fits, fits_slowly);
  EXPECT_EQ(whole.is_over(), slow.is_over());
  EXPECT_EQ(whole.is_over(), fits && is_over) << bytes.substr(0, 40);
  return fits;
}

TEST(ChunkScanner, LetsBodiesPass) {
  EXPECT_TRUE(is_body("0\r\n\r\n", true));
  EXPECT_TRUE(is_body("5\r\nhello\r\n0\r\n\r\n", true));
  EXPECT_TRUE(is_body("a\r\n0123456789\r\nB;name=value\r\n01234\r\n6789\r\n000\r\n\r\n", true));
  EXPECT_TRUE(is_body("1 \r\nx\r\n0\r\nTrailer: yes\r\n\r\n", true));
  EXPECT_TRUE(is_body("5\r\nhel", false));
  EXPECT_TRUE(is_body("5", false));
  EXPECT_TRUE(is_body("", false));
}

TEST(ChunkScanner, RefusesWhatIsNone) {
  for (const std::string bytes :
       {"\r\n", "x", "-5\r\n", "5\nhello", "5\r\nhello0\r\n", "5\r\nhello\n\n", "5\rx", "5x\r\n",
        "5;a\nb", "; name\r\n", "1234567890123456\r\n"}) {
    EXPECT_FALSE(is_body(bytes, false)) << bytes;
  }
}

TEST(ChunkScanner, BoundsWhatIsNoData) {
  EXPECT_FALSE(is_body(std::string(100, '0'), false));
  EXPECT_FALSE(is_body("1;" + std::string(ChunkScanner::kLongestLine, 'x'), false));
  EXPECT_FALSE(is_body("0\r\n" + std::string(ChunkScanner::kMostTrailers + 1, 'x'), false));
  std::string many;
  while (many.size() < ChunkScanner::kMostExtensions + 10'000) {
    many += "1;" + std::string(200, 'x') + "\r\ny\r\n";
  }
  EXPECT_FALSE(is_body(many, false));
}

TEST(ChunkScanner, StaysBroken) {
  ChunkScanner scanner;
  EXPECT_FALSE(scanner.scan("x"));
  EXPECT_FALSE(scanner.scan("0\r\n\r\n"));
}

}  // namespace
}  // namespace isomesh::net
