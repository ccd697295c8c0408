#include "server/net/request_head.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::net {
namespace {

using test::code_thrown_by;

const std::string kHost = "Host: a\r\n";

// The end that the scanner finds when it is given `step` more bytes at a time.
std::optional<std::size_t> scan(const std::string& bytes, std::size_t step) {
  HeadScanner scanner;
  for (std::size_t size = 0; size < bytes.size();) {
    size = std::min(size + step, bytes.size());
    if (const auto end = scanner.scan(std::string_view(bytes).substr(0, size))) return end;
  }
  return std::nullopt;
}

RequestHead head_of(const std::string& line, const std::string& headers = kHost) {
  return parse_head(line + "\r\n" + headers + "\r\n");
}

BodyFraming framing(const std::string& headers, const std::string& version = "HTTP/1.1") {
  return framing_of(head_of("POST / " + version, kHost + headers));
}

TEST(HeadScanner, FindsTheEndHoweverTheBytesCome) {
  const std::string head = "GET / HTTP/1.1\r\nHost: a\r\n\r\n";
  for (std::size_t step = 1; step <= head.size() + 3; ++step) {
    EXPECT_EQ(scan(head + "body", step), head.size()) << step;
    EXPECT_EQ(scan("\r\n\r\n" + head, step), head.size() + 4) << step;  // RFC 9112, 2.2
  }
  for (std::size_t size = 0; size < head.size(); ++size) {
    EXPECT_EQ(scan(head.substr(0, size), 1), std::nullopt) << size;
  }
}

TEST(HeadScanner, RefusesAsSoonAsItCanBeNoHead) {
  for (const std::string& bytes :
       {std::string("GET / HTTP/1.1\n"), std::string("\n"), std::string("GET /\r "),
        std::string("GET /\x01"), std::string("\x16\x03\x01", 3), std::string("\0", 1),
        std::string("GET / HTTP/1.1\r\nHost: a\nX: b\r\n"),
        std::string("GET / HTTP/1.1\r\nX:\x7F")}) {
    EXPECT_EQ(code_thrown_by([&] { scan(bytes, bytes.size()); }), ErrorCode::kInvalidParameter)
        << testing::PrintToString(bytes);
    EXPECT_EQ(code_thrown_by([&] { scan(bytes, 1); }), ErrorCode::kInvalidParameter);
  }
}

TEST(HeadScanner, BoundsLinesAndTheWhole) {
  const std::string line = "GET / HTTP/1.1\r\n";
  EXPECT_EQ(code_thrown_by([&] { scan(std::string(kLongestLine + 1, 'a'), 1000); }),
            ErrorCode::kUriTooLong);
  EXPECT_EQ(code_thrown_by([&] { scan(line + std::string(kLongestLine + 1, 'a'), 1000); }),
            ErrorCode::kHeadersTooLarge);
  EXPECT_EQ(scan(line + "X: " + std::string(kLongestLine - 10, 'a'), 1000), std::nullopt);
  std::string many = line;
  while (many.size() <= kLongestHead) many += "X: " + std::string(1000, 'a') + "\r\n";
  EXPECT_EQ(code_thrown_by([&] { scan(many, 1000); }), ErrorCode::kHeadersTooLarge);
}

TEST(ParseHead, TakesItApart) {
  const RequestHead head = head_of("POST /v1/jobs?a=b?c HTTP/1.1",
                                   "Host: a\r\nX-One:1\r\nX-Two: \t 2 x \r\nX-None:\r\n");
  EXPECT_EQ(head.method, "POST");
  EXPECT_EQ(head.target, "/v1/jobs?a=b?c");
  EXPECT_EQ(head.version, "HTTP/1.1");
  EXPECT_EQ(*find_header(head.headers, "x-one"), "1");
  EXPECT_EQ(*find_header(head.headers, "X-TWO"), "2 x");
  EXPECT_EQ(*find_header(head.headers, "X-None"), "");
  EXPECT_EQ(find_header(head.headers, "X-Three"), nullptr);
}

TEST(ParseHead, AnAbsoluteTargetIsItsPath) {
  EXPECT_EQ(head_of("GET http://host:80/livez?x HTTP/1.1").target, "/livez?x");
  EXPECT_EQ(head_of("GET HTTPS://host HTTP/1.1").target, "/");
  EXPECT_EQ(head_of("GET http://host?x HTTP/1.1").target, "/?x");
  EXPECT_EQ(head_of("OPTIONS * HTTP/1.1").target, "*");
}

TEST(ParseHead, RefusesWhatIsNone) {
  for (const std::string line :
       {"GET", "GET /", "GET / HTTP/1.1 ", "GET  HTTP/1.1", "GET / HTTP/2.0", "GET / http/1.1",
        "G(T / HTTP/1.1", "GET livez HTTP/1.1", "GET /a b HTTP/1.1", "GET /a#b HTTP/1.1",
        "GET /\xC3\xA4 HTTP/1.1", "\tGET / HTTP/1.1", "GET ftp://a/ HTTP/1.1"}) {
    EXPECT_EQ(code_thrown_by([&] { head_of(line); }), ErrorCode::kInvalidParameter) << line;
  }
  for (const std::string header : {"X : a", "X", ": a", " X: folded", "\tX: folded", "X(: a"}) {
    EXPECT_EQ(code_thrown_by([&] { head_of("GET / HTTP/1.1", kHost + header + "\r\n"); }),
              ErrorCode::kInvalidParameter)
        << header;
  }
}

TEST(Framing, HasOneReading) {
  EXPECT_FALSE(framing("").chunked);
  EXPECT_EQ(framing("").length, std::nullopt);
  EXPECT_EQ(framing("Content-Length: 0\r\n").length, 0U);
  EXPECT_EQ(framing("Content-Length: 18446744073709551615\r\n").length, 18446744073709551615U);
  EXPECT_TRUE(framing("Transfer-Encoding: Chunked\r\n").chunked);
  for (const std::string length : {"", "-1", "+1", "0x1", "1,1", "18446744073709551616", "1.0"}) {
    EXPECT_EQ(code_thrown_by([&] { framing("Content-Length: " + length + "\r\n"); }),
              ErrorCode::kInvalidParameter)
        << length;
  }
  for (const std::string headers :
       {"Content-Length: 1\r\nContent-Length: 1\r\n",
        "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: gzip, chunked\r\n", "Transfer-Encoding: identity\r\n",
        "Transfer-Encoding: xchunked\r\n"}) {
    EXPECT_EQ(code_thrown_by([&] { framing(headers); }), ErrorCode::kInvalidParameter) << headers;
  }
  EXPECT_EQ(code_thrown_by([&] { framing("Transfer-Encoding: chunked\r\n", "HTTP/1.0"); }),
            ErrorCode::kInvalidParameter);
}

}  // namespace
}  // namespace isomesh::net
