// A strict and bounded parser of HTTP/1 request heads (RFC 9112). The HTTP library accepts heads of
// any length, decodes percent signs in headers and tolerates malformed ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh::net {

inline constexpr std::size_t kLongestLine = 8192;
inline constexpr std::size_t kLongestHead = 32 * 1024;
inline constexpr std::size_t kMostHeaders = 100;

using Headers = std::vector<std::pair<std::string, std::string>>;

// Compares names of headers, which are case-insensitive.
bool equal_names(std::string_view a, std::string_view b);

// The value of the first header of that name; null if missing.
const std::string* find_header(const Headers& headers, std::string_view name);

// A character of a token, such as a header's name (RFC 9110, 5.6.2).
bool is_token_character(char c);

// A character that no header's value may have.
bool is_control(char c);

struct RequestHead {
  std::string method;
  std::string target;   // path and query
  std::string version;  // HTTP/1.0 or HTTP/1.1
  Headers headers;
};

// Finds the end of a head that arrives in pieces. A plain value.
class HeadScanner {
 public:
  // Continues with `received`, all bytes so far. Returns the size of the head with its empty line,
  // or empty if it is incomplete. Throws Error kUriTooLong, kHeadersTooLarge or kInvalidParameter
  // as soon as the bytes cannot start a valid head.
  std::optional<std::size_t> scan(std::string_view received);

 private:
  std::size_t scanned_ = 0;
  std::size_t line_begin_ = 0;
  bool has_request_line_ = false;
};

// Parses a whole head. An absolute target becomes its path and query. Throws Error
// kInvalidParameter or kHeadersTooLarge.
RequestHead parse_head(std::string_view head);

// The length of a request's body. Ambiguous lengths allow request smuggling past a proxy, so only
// one interpretation is accepted (RFC 9112, 6.3).
struct BodyFraming {
  bool chunked = false;
  std::optional<std::uint64_t> length;
};

// Throws Error kInvalidParameter with the header's name.
BodyFraming framing_of(const RequestHead& head);

}  // namespace isomesh::net
