#include "server/http/requests/request_values.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/base64.h"
#include "base/clock.h"
#include "base/hex.h"
#include "base/sha256.h"
#include "base/text.h"
#include "server/http/limits.h"
#include "server/net/request_head.h"

namespace isomesh::http {
namespace {

// Numbers in headers and queries have no sign "+", which base/text allows.
std::optional<double> number_of(std::string_view text) {
  return text.starts_with('+') ? std::nullopt : parse_double(text);
}

// The value of a preference (RFC 7240) in the header, without quotes and parameters; "" if it has
// no value.
std::optional<std::string> preference_in(std::string_view header, std::string_view wanted) {
  for (const std::string_view preference : split(header, ',')) {
    const std::size_t equals = preference.find('=');
    const bool has_value = equals != std::string_view::npos;
    const std::string_view name =
        has_value ? trimmed(preference.substr(0, equals)) : split(preference, ';').front();
    if (!net::equal_names(name, wanted)) continue;
    return has_value ? unquoted(split(preference.substr(equals + 1), ';').front()) : "";
  }
  return std::nullopt;
}

std::string hex_of_base64(std::string_view text, const std::string& header) {
  const auto digest = from_base64(text);
  if (!digest || digest->size() != Sha256::kBytes) {
    throw invalid_parameter(header, "sha-256 must be 32 bytes in base64 between colons");
  }
  return to_hex(*digest);
}

// A member of a digest header: an algorithm and bytes in base64 between colons (RFC 9530).
std::pair<std::string_view, std::string_view> digest_member(std::string_view member,
                                                            const std::string& header) {
  const std::size_t equals = member.find('=');
  const std::string_view name = member.substr(0, equals);
  const std::string_view value = equals == std::string_view::npos ? "" : member.substr(equals + 1);
  constexpr std::string_view kBase64 =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=";
  const bool is_bytes =
      value.size() >= 2 && value.front() == ':' && value.back() == ':' &&
      value.substr(1, value.size() - 2).find_first_not_of(kBase64) == std::string_view::npos;
  if (name.empty() || !is_bytes) {
    throw invalid_parameter(header, "must be NAME=:BASE64:, such as sha-256=:...:");
  }
  return {name, value.substr(1, value.size() - 2)};
}

// Weak tags are for caches: they mark equivalent, not identical bytes (RFC 9110, 8.8.3.2).
enum class Comparison { kStrong, kWeak };

bool names_etag(std::string_view header, std::string_view etag, Comparison comparison) {
  for (std::string_view tag : split(header, ',')) {
    if (comparison == Comparison::kWeak && tag.starts_with("W/")) tag.remove_prefix(2);
    if (tag == "*" || tag == etag) return true;
  }
  return false;
}

// The end of the value at the beginning of the text: the next semicolon outside of quotes.
std::size_t end_of_value(std::string_view text) {
  bool is_quoted = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] == ';' && !is_quoted) return at;
    if (text[at] == '"') is_quoted = !is_quoted;
    if (text[at] == '\\' && is_quoted) ++at;
  }
  return text.size();
}

// How well a media type fits a range of Accept, more specific ranges first; 0 if it does not.
int fit_of(std::string_view range, std::string_view asked_version, std::string_view type,
           std::string_view version) {
  const std::string_view main_type = type.substr(0, type.find('/'));
  if (range == "*/*") return 1;
  if (range.ends_with("/*") && range.substr(0, range.size() - 2) == main_type) return 2;
  if (range != type) return 0;
  if (asked_version.empty()) return 3;
  return asked_version == version ? 4 : 0;
}

}  // namespace

bool prefers(const Request& request, std::string_view preference) {
  return preference_in(request.header("Prefer"), preference).has_value();
}

std::optional<std::uint64_t> whole_number(std::string_view text) {
  return text.starts_with('+') ? std::nullopt : parse_uint64(text);
}

std::vector<double> numbers_of(const std::string& name, std::string_view text, std::size_t count) {
  const Error wrong =
      invalid_parameter(name, "must be " + std::to_string(count) + " numbers separated by commas");
  const std::vector<std::string_view> parts = split(text, ',');
  if (parts.size() != count) throw wrong;
  std::vector<double> numbers;
  for (const std::string_view part : parts) {
    const auto number = number_of(part);
    if (!number) throw wrong;
    numbers.push_back(*number);
  }
  return numbers;
}

void check_known(const Request& request, const std::set<std::string>& known) {
  std::vector<FieldError> errors;
  for (const auto& [name, unused] : request.query) {
    constexpr std::size_t kLongestName = 64;
    const std::string shown = name.substr(0, kLongestName);
    if (!errors.empty() && errors.back().field == shown) continue;  // already reported
    if (!known.contains(name)) {
      errors.push_back({shown, "is not a parameter of this request"});
    } else if (request.count_parameters(name) > 1) {
      errors.push_back({shown, "is given more than once"});
    }
  }
  if (!errors.empty()) throw invalid_parameters(std::move(errors));
}

std::chrono::milliseconds wait_of(const Request& request) {
  const bool in_query = request.has_parameter("wait");
  const auto text = in_query ? std::optional(std::string(request.parameter("wait")))
                             : preference_in(request.header("Prefer"), "wait");
  if (!text) return std::chrono::milliseconds(0);
  const auto seconds = number_of(*text);
  if (!seconds || !std::isfinite(*seconds) || *seconds < 0) {
    throw invalid_parameter(in_query ? "wait" : "Prefer",
                            in_query ? "must be a number of seconds, at least 0"
                                     : "wait must be a number of seconds, at least 0");
  }
  return std::chrono::milliseconds(
      static_cast<std::int64_t>(std::min<double>(*seconds, limits::kLongestWait.count()) * 1000));
}

std::string idempotency_key_of(const Request& request) {
  constexpr const char* kHeader = "Idempotency-Key";
  if (!request.has_header(kHeader)) return {};
  std::string key(request.header(kHeader));
  const bool is_printable = std::ranges::all_of(key, [](char c) { return c > 0x20 && c < 0x7F; });
  if (request.count_headers(kHeader) > 1 || key.empty() ||
      key.size() > limits::kLongestIdempotencyKey || !is_printable) {
    throw invalid_parameter(kHeader, "must be one key of 1 to 255 printable characters");
  }
  return key;
}

std::optional<std::string> sha256_of_digest(const Request& request, const std::string& header) {
  if (!request.has_header(header)) return std::nullopt;
  std::optional<std::string> sha256;
  for (const std::string_view member : split(request.header(header), ',')) {
    const auto [name, value] = digest_member(member, header);
    if (name != "sha-256") continue;
    if (sha256) throw invalid_parameter(header, "names sha-256 twice");
    sha256 = hex_of_base64(value, header);
  }
  return sha256;
}

std::string digest_header(std::string_view sha256) {
  return "sha-256=:" + to_base64(from_hex(sha256).value()) + ':';
}

std::uint64_t whole_number_of(const Request& request, const std::string& name,
                              const WholeNumbers& among, std::uint64_t otherwise) {
  if (!request.has_parameter(name)) return otherwise;
  const auto number = whole_number(request.parameter(name));
  if (!number || *number < among.low || *number > among.high) {
    throw invalid_parameter(name, "must be a whole number from " + std::to_string(among.low) +
                                      " to " + std::to_string(among.high));
  }
  return *number;
}

std::int64_t whole_number_of(const Request& request, const std::string& name,
                             std::int64_t otherwise) {
  if (!request.has_parameter(name)) return otherwise;
  const std::string_view text = request.parameter(name);
  const auto number = parse_int64(text);
  if (!number || text.starts_with('+')) throw invalid_parameter(name, "must be a whole number");
  return *number;
}

bool flag_of(const Request& request, const std::string& name, bool otherwise) {
  if (!request.has_parameter(name)) return otherwise;
  const std::string_view text = request.parameter(name);
  if (text != "true" && text != "false") throw invalid_parameter(name, "must be true or false");
  return text == "true";
}

std::optional<std::chrono::system_clock::time_point> instant_of(const Request& request,
                                                                const std::string& name) {
  if (!request.has_parameter(name)) return std::nullopt;
  constexpr std::size_t kDay = std::string_view("2026-11-20").size();
  constexpr std::size_t kSecond = std::string_view("2026-11-20T07:30:00Z").size();
  std::string text(request.parameter(name));
  if (text.size() == kDay) text += "T00:00:00Z";
  if (text.size() == kSecond) text.insert(kSecond - 1, ".000");
  const auto time = nearest_time_of(text);
  if (!time) {
    throw invalid_parameter(
        name, "must be a day such as 2026-11-20, or a time in UTC such as 2026-11-20T07:30:00Z");
  }
  return time;
}

std::optional<std::array<double, 2>> interval_of(const Request& request, const std::string& name) {
  if (!request.has_parameter(name)) return std::nullopt;
  const auto interval = numbers_of(name, request.parameter(name), 2);
  const bool finite = std::isfinite(interval[0]) && std::isfinite(interval[1]);
  if (!finite || interval[0] >= interval[1]) {
    throw invalid_parameter(name, "must be two finite numbers, the smaller first");
  }
  return std::array{interval[0], interval[1]};
}

std::optional<ByteRange> range_of(const Request& request, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  const std::string_view header = request.header("Range");
  if (!header.starts_with(kUnit)) return std::nullopt;
  const std::string_view spec = trimmed(header.substr(kUnit.size()));
  const std::size_t dash = spec.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const std::string_view before = spec.substr(0, dash);
  const std::string_view after = spec.substr(dash + 1);
  const auto first = whole_number(before);
  const auto last = whole_number(after);
  if ((!before.empty() && !first) || (!after.empty() && !last) || (!first && !last) ||
      (first && last && *last < *first)) {
    return std::nullopt;  // several ranges or invalid syntax
  }
  const std::uint64_t begin = first ? *first : size - std::min(size, *last);
  const std::uint64_t end = first && last ? std::min(size - 1, *last) : size - 1;
  if (size == 0 || begin >= size || (!first && *last == 0)) {
    throw Error(ErrorCode::kRangeNotSatisfiable, "the file has " + std::to_string(size) + " bytes");
  }
  return ByteRange{begin, end - begin + 1};
}

double accepted_weight(const Request& request, std::string_view type, std::string_view version) {
  int best = 0;
  double weight = 0;
  for (const std::string_view each : split(request.header("Accept"), ',')) {
    const std::string range = lower(split(each, ';').front());
    const int fit = fit_of(range, header_parameter(each, "version"), type, version);
    const std::string given = header_parameter(each, "q");
    const double q = given.empty() ? 1 : number_of(given).value_or(0);
    // The greatest weight counts among ranges that fit equally well.
    if (fit < best || (fit == best && q <= weight)) continue;
    best = fit;
    weight = fit == 0 ? 0 : q;
  }
  return weight;
}

bool accepts_gzip(const Request& request) {
  const std::string_view header = request.header("Accept-Encoding");
  for (const std::string_view coding : split(header, ',')) {
    const std::vector<std::string_view> parts = split(coding, ';');
    if (parts[0] != "gzip" && parts[0] != "*") continue;
    const bool weighed = parts.size() > 1 && parts[1].starts_with("q=");
    return !weighed || number_of(parts[1].substr(2)).value_or(1) > 0;
  }
  return false;
}

bool matches_etag(const Request& request, std::string_view etag) {
  return names_etag(request.header("If-None-Match"), etag, Comparison::kWeak);
}

void check_if_match(const Request& request, std::string_view etag) {
  if (!request.has_header("If-Match")) return;
  if (names_etag(request.header("If-Match"), etag, Comparison::kStrong)) return;
  throw Error(ErrorCode::kPreconditionFailed, "the resource does not match If-Match");
}

std::string cursor_after(std::string_view kind, std::string_view id) {
  return to_hex(std::string(kind) + ':' + std::string(id));
}

std::string id_after(const Request& request, std::string_view kind) {
  if (!request.has_parameter("cursor")) return {};
  const std::string text = from_hex(request.parameter("cursor")).value_or("");
  const std::string prefix = std::string(kind) + ':';
  const bool is_ours = text.size() > prefix.size() && text.size() <= limits::kLongestCursor &&
                       text.starts_with(prefix) &&
                       std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
  if (!is_ours) throw wrong_cursor();
  return text.substr(prefix.size());
}

std::optional<std::int64_t> label_after(const Request& request, std::string_view kind) {
  const std::string after = id_after(request, kind);
  if (after.empty()) return std::nullopt;
  const auto label = parse_int64(after);
  if (!label) throw wrong_cursor();
  return label;
}

Error wrong_cursor() {
  return invalid_parameter("cursor", "must be the `next` of a page of this list");
}

std::optional<std::uint64_t> last_event_id(const Request& request) {
  if (!request.has_header("Last-Event-ID")) return std::nullopt;
  const auto number = whole_number(request.header("Last-Event-ID"));
  if (!number)
    throw invalid_parameter("Last-Event-ID", "must be the id of an event of this stream");
  constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();  // the store's limit
  return std::min(*number, kLargest);
}

std::string header_parameter(std::string_view header, std::string_view name) {
  header.remove_prefix(end_of_value(header));
  while (!header.empty()) {
    header.remove_prefix(1);  // the semicolon
    const std::string_view parameter = header.substr(0, end_of_value(header));
    const std::size_t equals = std::min(parameter.find('='), parameter.size());
    if (equals < parameter.size() && net::equal_names(trimmed(parameter.substr(0, equals)), name)) {
      return unquoted(parameter.substr(equals + 1));
    }
    header.remove_prefix(parameter.size());
  }
  return {};
}

std::string unquoted(std::string_view text) {
  text = trimmed(text);
  if (!text.starts_with('"')) return std::string(text);
  std::string value;
  for (std::size_t at = 1; at < text.size() && text[at] != '"'; ++at) {
    if (text[at] == '\\' && at + 1 < text.size()) ++at;
    value += text[at];
  }
  return value;
}

}  // namespace isomesh::http
