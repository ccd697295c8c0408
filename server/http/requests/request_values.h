// Parses and bounds values of headers and queries. Free functions, thread safe. They throw Error
// kInvalidParameter with the name of the malformed header or parameter.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "proto/json.h"
#include "proto/types.h"
#include "server/http/requests/request.h"

namespace isomesh::http {

// Rejects parameters that are not in `known`.
void check_known(const Request& request, const std::set<std::string>& known);

// True if the client has that preference in `Prefer` (RFC 7240), with any value.
bool prefers(const Request& request, std::string_view preference);

// The longest time until the response: `?wait=N` or `Prefer: wait=N` in seconds, at most 30.
std::chrono::milliseconds wait_of(const Request& request);

// The Idempotency-Key header; empty if missing. At most 255 printable characters.
std::string idempotency_key_of(const Request& request);

// The SHA-256 in a header such as Content-Digest (RFC 9530), as hex; empty if the header is missing
// or has only other algorithms.
std::optional<std::string> sha256_of_digest(const Request& request, const std::string& header);
inline std::optional<std::string> sha256_of_content_digest(const Request& request) {
  return sha256_of_digest(request, "Content-Digest");
}

// The value of Repr-Digest for a SHA-256 in hex.
std::string digest_header(std::string_view sha256);

// An unsigned number; empty for anything else.
std::optional<std::uint64_t> whole_number(std::string_view text);

// `count` numbers, separated by commas, possibly infinite or NaN.
std::vector<double> numbers_of(const std::string& name, std::string_view text, std::size_t count);

struct WholeNumbers {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
};

// The parameter's value, which must be in `among`; `otherwise` if missing.
std::uint64_t whole_number_of(const Request& request, const std::string& name,
                              const WholeNumbers& among, std::uint64_t otherwise);

// The same for any number of 64 bits.
std::int64_t whole_number_of(const Request& request, const std::string& name,
                             std::int64_t otherwise);

// True or false; `otherwise` if missing.
bool flag_of(const Request& request, const std::string& name, bool otherwise);

// A day, or a time in UTC as responses write it; empty if missing.
std::optional<std::chrono::system_clock::time_point> instant_of(const Request& request,
                                                                const std::string& name);

// Two finite ascending numbers; empty without the parameter.
std::optional<std::array<double, 2>> interval_of(const Request& request, const std::string& name);

struct ByteRange {
  std::uint64_t first = 0;
  std::uint64_t length = 0;
};

// One range of a file of `size` bytes. Empty without a Range header, and for one that RFC 9110
// permits to ignore: other units, several ranges, invalid syntax. Throws Error kRangeNotSatisfiable
// if the range is outside of the file.
std::optional<ByteRange> range_of(const Request& request, std::uint64_t size);

// The weight that Accept gives to a version of a media type, from 0 to 1 (RFC 9110, 12.5.1). 0 if
// the header does not accept it or is missing.
double accepted_weight(const Request& request, std::string_view type, std::string_view version);

// True if the client accepts gzip (RFC 9110, 12.5.3).
bool accepts_gzip(const Request& request);

// True if If-None-Match has the entity tag (with quotes).
bool matches_etag(const Request& request, std::string_view etag);

// Throws Error kPreconditionFailed for an If-Match without the entity tag.
void check_if_match(const Request& request, std::string_view etag);

// The parameter `cursor` for the entries after that id in a list. Other kinds of lists reject it.
std::string cursor_after(std::string_view kind, std::string_view id);

// The `id` in the parameter `cursor`, printable ASCII; empty if missing.
std::string id_after(const Request& request, std::string_view kind);

// The label in the parameter `cursor` of a list of labels; empty without one.
std::optional<std::int64_t> label_after(const Request& request, std::string_view kind);

Error wrong_cursor();

// The last event that a reconnecting client has seen; empty if missing.
std::optional<std::uint64_t> last_event_id(const Request& request);

// The value of a parameter such as the name in `attachment; filename="a b.nii"` (RFC 9110, 5.6.6),
// without quotes; empty if missing. Names of parameters are case-insensitive.
std::string header_parameter(std::string_view header, std::string_view name);

// A word or a quoted string, without the quotes.
std::string unquoted(std::string_view text);

}  // namespace isomesh::http
