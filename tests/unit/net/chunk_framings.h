// Bodies in chunks as sent, and what every reader of them must say.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/net/chunk_decoder.h"

namespace isomesh::net {

struct ChunkFraming {
  std::string bytes;
  std::optional<std::string> data;  // empty if the bytes are not a chunked body
};

inline std::vector<ChunkFraming> chunk_framings() {
  const std::string hello = "5\r\nhello\r\n";
  const std::string end = "0\r\n\r\n";
  const std::string longest = "X: " + std::string(ChunkDecoder::kMostTrailers - 7, 'x') + "\r\n";
  std::string many;
  while (many.size() < ChunkDecoder::kMostExtensions + 10'000) {
    many += "1;" + std::string(200, 'x') + "\r\ny\r\n";
  }
  constexpr std::size_t kSmallChunks = 30'000;  // more line breaks than extensions may have bytes
  std::string small;
  for (std::size_t n = 0; n < kSmallChunks; ++n) small += "1\r\ny\r\n";
  std::vector<ChunkFraming> framings = {
      {end, ""},
      {small + end, std::string(kSmallChunks, 'y')},
      {hello + end, "hello"},
      {"a\r\n0123456789\r\nB\r\n0123456789x\r\n" + end, "01234567890123456789x"},
      {"5\r\nhel\r\n\r\n" + end, "hel\r\n"},
      {"005\r\nhello\r\n000\r\n\r\n", "hello"},
      {std::string(100, '0') + "5\r\nhello\r\n" + std::string(100, '0') + "\r\n\r\n", "hello"},
      {"5 \t\r\nhello\r\n" + end, "hello"},
      {"5;name\r\nhello\r\n" + end, "hello"},
      {"5;a=b;c=\"d\"\r\nhello\r\n0;last\r\n\r\n", "hello"},
      {"5 ; a = b ;c = \"d\" \r\nhello\r\n" + end, "hello"},
      {"5;a=\"; \\\" \\\\ \t\xc3\xa4\"\r\nhello\r\n" + end, "hello"},
      {hello + "0\r\nX-Checksum: abc\r\n\r\n", "hello"},
      {hello + "0\r\nA: 1\r\nB:\r\nC:\t2 \xc3\xa4\r\n\r\n", "hello"},
      {hello + "0\r\nContent-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n", "hello"},
      {hello + "0\r\n" + longest + "\r\n", "hello"},
      {many + end, {}},
      {hello + "0\r\nX" + longest + "\r\n", {}},
  };
  for (const std::string& broken : {
           std::string("\r\n"),
           std::string("x\r\n"),
           std::string("-5\r\nhello\r\n"),
           std::string("0x5\r\nhello\r\n"),
           std::string(" 5\r\nhello\r\n"),
           std::string("5\nhello\r\n"),
           std::string("5\rxhello\r\n"),
           std::string("5\r\nhello0\r\n"),
           std::string("5\r\nhello\n\n"),
           std::string("5\r\nhello\r\r\n"),
           std::string("5x\r\nhello\r\n"),
           std::string("5 5\r\nhello\r\n"),
           std::string("5\0\r\nhello\r\n", 11),
           std::string("; name\r\nhello\r\n"),
           std::string("5;\r\nhello\r\n"),
           std::string("5;a=\r\nhello\r\n"),
           std::string("5;a b\r\nhello\r\n"),
           std::string("5;a=\"b\r\nhello\r\n"),
           std::string("5;a=\"b\"c\r\nhello\r\n"),
           std::string("5;a=\"\\\r\"\r\nhello\r\n"),
           std::string("5;a=(b)\r\nhello\r\n"),
           std::string("5;a\nb\r\nhello\r\n"),
           std::string("1000000000000000\r\n"),
           std::string("ffffffffffffffff\r\n"),
           "5;" + std::string(ChunkDecoder::kLongestLine, 'x') + "\r\nhello\r\n",
           std::string(ChunkDecoder::kLongestLine, '0') + "5\r\nhello\r\n",
           std::string("0\r\nno colon\r\n"),
           std::string("0\r\nName : blank before the colon\r\n"),
           std::string("0\r\n: no name\r\n"),
           std::string("0\r\nA: folded\r\n over lines\r\n"),
           std::string("0\r\n \r\n"),
           std::string("0\r\nA: line feed\n"),
           std::string("0\r\nA: return \r inside\r\n"),
           std::string("0\r\nA: nul \0\r\n", 13),
           std::string("0\r\n\rx"),
           std::string("0\r\n\n"),
       }) {
    framings.push_back({broken + end, {}});
  }
  return framings;
}

}  // namespace isomesh::net
