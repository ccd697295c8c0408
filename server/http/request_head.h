// The head of an HTTP/1 request, read strictly and with bounds (RFC 9112): what the library would
// take in any length and forgive in many forms.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh::http {

inline constexpr std::size_t kLongestLine = 8192;
inline constexpr std::size_t kLongestHead = 32 * 1024;
inline constexpr std::size_t kMostHeaders = 100;

struct RequestHead {
  std::string method;
  std::string target;  // path and query
  std::string version;
  std::vector<std::pair<std::string, std::string>> headers;

  // The value of the first header of that name, in any case; empty without one.
  const std::string* find(std::string_view name) const;
};

// Finds the end of a head that comes piece by piece. Plain value.
class HeadScanner {
 public:
  // Looks at what has come since the last call; `received` is all of it. Returns the size of the
  // head with its empty line, or nothing when there is more to come. Throws Error kUriTooLong,
  // kHeadersTooLarge or kInvalidParameter as soon as it can become no head any more.
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

  bool has_body() const { return chunked || length.value_or(0) > 0; }
};

// Throws Error kInvalidParameter that names the header.
BodyFraming framing_of(const RequestHead& head);

}  // namespace isomesh::http
