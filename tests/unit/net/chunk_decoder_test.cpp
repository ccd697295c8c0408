#include "server/net/chunk_decoder.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>

#include <gtest/gtest.h>

#include "tests/unit/net/chunk_framings.h"

namespace isomesh::net {
namespace {

struct Decoded {
  std::optional<std::string> data;  // empty if the bytes are not a chunked body
  bool is_over = false;
};

// The bytes come in pieces of that size.
Decoded decode(const std::string& bytes, std::size_t piece_bytes) {
  ChunkDecoder decoder;
  std::optional<std::string> data = "";
  for (std::size_t at = 0; at < bytes.size(); at += piece_bytes) {
    std::string piece = bytes.substr(at, piece_bytes);
    const auto count = decoder.decode(piece);
    if (!count) data.reset();
    if (data) data->append(piece, 0, *count);
    EXPECT_EQ(count.has_value(), data.has_value()) << "it stays broken";
  }
  return {data, decoder.is_over()};
}

TEST(ChunkDecoder, AgreesWithEveryFramingInWhateverPieces) {
  for (const auto& [bytes, data] : chunk_framings()) {
    for (const std::size_t piece : {bytes.size(), std::size_t{1}, std::size_t{7}}) {
      const Decoded decoded = decode(bytes, piece);
      EXPECT_EQ(decoded.data, data) << testing::PrintToString(bytes.substr(0, 80));
      EXPECT_EQ(decoded.is_over, data.has_value()) << testing::PrintToString(bytes.substr(0, 80));
    }
  }
}

TEST(ChunkDecoder, IsNotOverBeforeTheLastByte) {
  for (const auto& [bytes, data] : chunk_framings()) {
    if (!data || bytes.size() > 1000) continue;
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const Decoded decoded = decode(bytes.substr(0, size), bytes.size());
      EXPECT_TRUE(decoded.data.has_value());
      EXPECT_FALSE(decoded.is_over) << size << " of " << testing::PrintToString(bytes);
    }
  }
}

TEST(ChunkDecoder, IgnoresWhatFollowsTheBody) {
  const Decoded decoded = decode("1\r\nx\r\n0\r\n\r\nGET / HTTP/1.1\r\n", 100);
  EXPECT_EQ(decoded.data, "x");
  EXPECT_TRUE(decoded.is_over);
}

}  // namespace
}  // namespace isomesh::net
