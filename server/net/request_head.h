// The head of an HTTP/1 request, read strictly and with bounds (RFC 9112). The HTTP library takes
// heads of any length, decodes percent signs in headers and forgives malformed ones.
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

// Names of headers are the same in any case.
bool equal_names(std::string_view a, std::string_view b);

// The value of the first header of that name; null without one.
const std::string* find_header(const Headers& headers, std::string_view name);

struct RequestHead {
  std::string method;
  std::string target;   // path and query
  std::string version;  // HTTP/1.0 or HTTP/1.1
  Headers headers;
};

// Finds the end of a head that comes piece by piece. Plain value.
class HeadScanner {
 public:
  // Looks at what has come since the last call; `received` is all of it. Returns the size of the
  // head with its empty line, or nothing when there is more to come. Throws Error kUriTooLong,
  // kHeadersTooLarge or kInvalidParameter as soon as what has come cannot be the begin of a head.
  std::optional<std::size_t> scan(std::string_view received);

 private:
  std::size_t scanned_ = 0;
  std::size_t line_begin_ = 0;
  bool has_request_line_ = false;
};

// Reads a whole head. An absolute target becomes its path and query. Throws Error kInvalidParameter
// or kHeadersTooLarge.
RequestHead parse_head(std::string_view head);

// How long a request's body is. Two readings of that are how requests are smuggled past a proxy, so
// there is only one (RFC 9112, 6.3).
struct BodyFraming {
  bool chunked = false;
  std::optional<std::uint64_t> length;
};

// Throws Error kInvalidParameter that names the header.
BodyFraming framing_of(const RequestHead& head);

}  // namespace isomesh::net
