// What requests say in their headers and queries, parsed and bounded. Free functions, thread safe;
// what is malformed throws Error kInvalidParameter that names the header or parameter.
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
#include "server/http/request.h"

namespace isomesh::http {

// Refuses parameters that are not among `known`.
void check_known(const Request& request, const std::set<std::string>& known);

// Whether the client asks for that by `Prefer` (RFC 7240), whatever it says of it.
bool prefers(const Request& request, std::string_view preference);

// How long the answer may wait: `?wait=N` or `Prefer: wait=N` in seconds; more than 30 are 30.
std::chrono::milliseconds wait_of(const Request& request);

// The Idempotency-Key header, as it is; empty without one. At most 255 printable characters.
std::string idempotency_key_of(const Request& request);

// The SHA-256 that a header such as Content-Digest names (RFC 9530), as hex; empty when it names
// none, but only other algorithms.
std::optional<std::string> sha256_of_digest(const Request& request, const std::string& header);
inline std::optional<std::string> sha256_of_content_digest(const Request& request) {
  return sha256_of_digest(request, "Content-Digest");
}

// What Repr-Digest holds for that SHA-256 in hex.
std::string digest_header(std::string_view sha256);

// A number without a sign; empty for anything else.
std::optional<std::uint64_t> whole_number(std::string_view text);

// So many numbers, of which some may be infinite or none, with commas between.
std::vector<double> numbers_of(const std::string& name, std::string_view text, std::size_t count);

struct WholeNumbers {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
};

// The parameter's value, which must be among those; `otherwise` without the parameter.
std::uint64_t whole_number_of(const Request& request, const std::string& name,
                              const WholeNumbers& among, std::uint64_t otherwise);

// The same of any that 64 bits hold.
std::int64_t whole_number_of(const Request& request, const std::string& name,
                             std::int64_t otherwise);

// Two finite numbers of which the second is greater; empty without the parameter.
std::optional<std::array<double, 2>> interval_of(const Request& request, const std::string& name);

struct ByteRange {
  std::uint64_t first = 0;
  std::uint64_t length = 0;
};

// One range of a file of `size` bytes. Empty when there is no Range header, or one that RFC 9110
// lets a server ignore: other units, several ranges, bad syntax. Throws Error kRangeNotSatisfiable
// when the range lies outside of the file.
std::optional<ByteRange> range_of(const Request& request, std::uint64_t size);

// True when the client takes answers compressed with gzip (RFC 9110, 12.5.3).
bool accepts_gzip(const Request& request);

// True when If-None-Match names the entity tag (quotes included).
bool matches_etag(const Request& request, std::string_view etag);

// Throws Error kPreconditionFailed when there is an If-Match that does not name the entity tag.
void check_if_match(const Request& request, std::string_view etag);

// The text by which a client asks for what follows that id in a list (the parameter `cursor`). A
// list of another kind refuses it.
std::string cursor_after(std::string_view kind, std::string_view id);

// The `id` in the parameter `cursor`, printable ASCII; empty without one.
std::string id_after(const Request& request, std::string_view kind);

// The label in the parameter `cursor` of a list of labels; empty without one.
std::optional<std::int64_t> label_after(const Request& request, std::string_view kind);

// The error of a cursor that cursor_after has not made for this list.
Error wrong_cursor();

// The last event that a client has seen before it came back to a stream; empty without one.
std::optional<std::uint64_t> last_event_id(const Request& request);

}  // namespace isomesh::http
