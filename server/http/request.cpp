#include "server/http/request.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include <httplib.h>
#include <openssl/evp.h>
#include <strings.h>

#include "server/store/files.h"

namespace isomesh::http {
namespace {

constexpr int kLongestWaitSeconds = 30;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

// The parts are views of `text`, which must outlive them.
std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

template <class Number, std::size_t N>
std::array<Number, N> numbers_of(const std::string& name, std::string_view text) {
  const std::vector<std::string_view> parts = split(text, ',');
  std::array<Number, N> numbers = {};
  bool valid = parts.size() == N;
  for (std::size_t i = 0; valid && i < N; ++i) {
    const auto number = number_of<Number>(parts[i]);
    valid = number.has_value();
    if (valid) numbers[i] = *number;
  }
  if (!valid) {
    throw invalid_parameter(name, "must be " + std::to_string(N) + " numbers with commas between");
  }
  return numbers;
}

// The seconds of a preference `wait=N` (RFC 7240), among others in the header and before what may
// describe it.
std::optional<std::string_view> preferred_wait(std::string_view header) {
  for (const std::string_view preference : split(header, ',')) {
    const std::size_t equals = preference.find('=');
    const std::string_view name = trimmed(preference.substr(0, equals));
    if (name.size() != 4 || ::strncasecmp(name.data(), "wait", 4) != 0) continue;
    if (equals == std::string_view::npos) return "";
    return trimmed(split(preference.substr(equals + 1), ';').front());
  }
  return std::nullopt;
}

constexpr std::size_t kSha256InBase64 = 44;  // 32 bytes, and one character that fills up

std::string hex_of_base64(std::string_view text) {
  std::array<unsigned char, 48> bytes = {};
  const bool right_length = text.size() == kSha256InBase64 && text[43] == '=' && text[42] != '=';
  if (!right_length ||
      EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(text.data()),
                      static_cast<int>(text.size())) < 0) {
    throw invalid_parameter("Content-Digest", "sha-256 must be 32 bytes in base64 between colons");
  }
  return store::to_hex({bytes.data(), store::Sha256::kBytes});
}

unsigned char nibble(char digit) {
  return static_cast<unsigned char>(digit <= '9' ? digit - '0' : digit - 'a' + 10);
}

// A member of a digest header: an algorithm's name and bytes in base64 between colons (RFC 9530).
std::pair<std::string_view, std::string_view> digest_member(std::string_view member) {
  const std::size_t equals = member.find('=');
  const std::string_view name = member.substr(0, equals);
  const std::string_view value = equals == std::string_view::npos ? "" : member.substr(equals + 1);
  constexpr std::string_view kBase64 =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=";
  const bool is_bytes =
      value.size() >= 2 && value.front() == ':' && value.back() == ':' &&
      value.substr(1, value.size() - 2).find_first_not_of(kBase64) == std::string_view::npos;
  if (name.empty() || !is_bytes) {
    throw invalid_parameter("Content-Digest", "must be NAME=:BASE64:, such as sha-256=:...:");
  }
  return {name, value.substr(1, value.size() - 2)};
}

bool names_etag(std::string_view header, std::string_view etag) {
  for (std::string_view tag : split(header, ',')) {
    if (tag.starts_with("W/")) tag.remove_prefix(2);
    if (tag == "*" || tag == etag) return true;
  }
  return false;
}

bool is_uid(std::string_view text) {
  constexpr std::size_t kLongestUid = 64;
  return !text.empty() && text.size() <= kLongestUid &&
         text.find_first_not_of("0123456789.") == std::string_view::npos;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> query_of(const httplib::Request& request) {
  return {request.params.begin(), request.params.end()};
}

void check_known(const httplib::Request& request, const std::set<std::string>& known) {
  std::vector<FieldError> errors;
  for (const auto& [name, unused] : request.params) {
    constexpr std::size_t kLongestName = 64;
    const std::string shown = name.substr(0, kLongestName);
    if (!errors.empty() && errors.back().field == shown) continue;  // said already
    if (!known.contains(name)) {
      errors.push_back({shown, "is not a parameter of this request"});
    } else if (request.get_param_value_count(name) > 1) {
      errors.push_back({shown, "is given more than once"});
    }
  }
  if (!errors.empty()) throw invalid_parameters(std::move(errors));
}

std::chrono::milliseconds wait_of(const httplib::Request& request) {
  const bool in_query = request.has_param("wait");
  const std::string header = request.get_header_value("Prefer");
  const std::string parameter = request.get_param_value("wait");
  const std::optional<std::string_view> text = in_query ? parameter : preferred_wait(header);
  if (!text) return std::chrono::milliseconds(0);
  const auto seconds = number_of<double>(*text);
  if (!seconds || !std::isfinite(*seconds) || *seconds < 0) {
    throw invalid_parameter(in_query ? "wait" : "Prefer",
                            in_query ? "must be a number of seconds, at least 0"
                                     : "wait must be a number of seconds, at least 0");
  }
  return std::chrono::milliseconds(
      static_cast<std::int64_t>(std::min<double>(*seconds, kLongestWaitSeconds) * 1000));
}

std::string idempotency_key_of(const httplib::Request& request) {
  constexpr const char* kHeader = "Idempotency-Key";
  constexpr std::size_t kLongest = 255;
  if (!request.has_header(kHeader)) return {};
  std::string key = request.get_header_value(kHeader);
  const bool is_printable = std::ranges::all_of(key, [](char c) { return c > 0x20 && c < 0x7F; });
  if (request.get_header_value_count(kHeader) > 1 || key.empty() || key.size() > kLongest ||
      !is_printable) {
    throw invalid_parameter(kHeader, "must be one key of 1 to 255 printable characters");
  }
  return key;
}

std::optional<std::string> sha256_of_content_digest(const httplib::Request& request) {
  if (!request.has_header("Content-Digest")) return std::nullopt;
  const std::string header = request.get_header_value("Content-Digest");
  std::optional<std::string> sha256;
  for (const std::string_view member : split(header, ',')) {
    const auto [name, value] = digest_member(member);
    if (name != "sha-256") continue;
    if (sha256) throw invalid_parameter("Content-Digest", "names sha-256 twice");
    sha256 = hex_of_base64(value);
  }
  return sha256;
}

std::string digest_header(std::string_view sha256) {
  std::array<unsigned char, store::Sha256::kBytes> bytes = {};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes.at(i) =
        static_cast<unsigned char>(nibble(sha256[2 * i]) << 4 | nibble(sha256[2 * i + 1]));
  }
  std::array<unsigned char, kSha256InBase64 + 1> text = {};
  EVP_EncodeBlock(text.data(), bytes.data(), static_cast<int>(bytes.size()));
  return "sha-256=:" + std::string(reinterpret_cast<const char*>(text.data())) + ':';
}

const std::set<std::string>& raw_description_parameters() {
  static const std::set<std::string> names = {"dims",   "type",      "spacing",
                                              "origin", "direction", "byte_order"};
  return names;
}

const std::set<std::string>& import_parameters() {
  static const std::set<std::string> names = [] {
    std::set<std::string> all = raw_description_parameters();
    all.insert("series");
    return all;
  }();
  return names;
}

volume::ImportOptions import_options_of(const httplib::Request& request) {
  volume::ImportOptions options{.raw = raw_description_of(request), .series = {}};
  if (!request.has_param("series")) return options;
  options.series = request.get_param_value("series");
  if (!is_uid(options.series)) {
    throw invalid_parameter("series", "must be a DICOM UID: digits and dots, at most 64 of them");
  }
  if (options.raw) throw invalid_parameter("series", "raw samples have no series");
  return options;
}

std::optional<volume::RawDescription> raw_description_of(const httplib::Request& request) {
  const auto text = [&](const char* name) { return request.get_param_value(name); };
  if (!request.has_param("dims")) {
    for (const std::string& name : raw_description_parameters()) {
      if (request.has_param(name)) {
        throw invalid_parameter("dims", "is required, because " + name + " describes raw samples");
      }
    }
    return std::nullopt;
  }
  volume::RawDescription raw;
  raw.dims = numbers_of<std::uint32_t, 3>("dims", text("dims"));
  const auto type = from_string<SampleType>(text("type"));
  if (!type) throw invalid_parameter("type", "must be " + names_of<SampleType>());
  raw.type = *type;
  if (request.has_param("spacing")) {
    raw.geometry.spacing = numbers_of<double, 3>("spacing", text("spacing"));
  }
  if (request.has_param("origin")) {
    raw.geometry.origin = numbers_of<double, 3>("origin", text("origin"));
  }
  if (request.has_param("direction")) {
    raw.geometry.direction = numbers_of<double, 9>("direction", text("direction"));
  }
  if (request.has_param("byte_order")) {
    const std::string order = text("byte_order");
    if (order != "little" && order != "big") {
      throw invalid_parameter("byte_order", "must be \"little\" or \"big\"");
    }
    raw.big_endian = order == "big";
  }
  return raw;
}

std::uint64_t whole_number_of(const httplib::Request& request, const std::string& name,
                              const WholeNumbers& among, std::uint64_t otherwise) {
  if (!request.has_param(name.c_str())) return otherwise;
  const auto number = number_of<std::uint64_t>(request.get_param_value(name.c_str()));
  if (!number || *number < among.low || *number > among.high) {
    throw invalid_parameter(name, "must be a whole number from " + std::to_string(among.low) +
                                      " to " + std::to_string(among.high));
  }
  return *number;
}

std::optional<std::array<double, 2>> interval_of(const httplib::Request& request,
                                                 const std::string& name) {
  if (!request.has_param(name.c_str())) return std::nullopt;
  const auto interval = numbers_of<double, 2>(name, request.get_param_value(name.c_str()));
  const bool finite = std::isfinite(interval[0]) && std::isfinite(interval[1]);
  if (!finite || interval[0] >= interval[1]) {
    throw invalid_parameter(name, "must be two finite numbers, the smaller first");
  }
  return interval;
}

std::optional<ByteRange> range_of(const httplib::Request& request, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  const std::string header = request.get_header_value("Range");
  if (!std::string_view(header).starts_with(kUnit)) return std::nullopt;
  const std::string_view spec = trimmed(std::string_view(header).substr(kUnit.size()));
  const std::size_t dash = spec.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const std::string_view before = spec.substr(0, dash);
  const std::string_view after = spec.substr(dash + 1);
  const auto first = number_of<std::uint64_t>(before);
  const auto last = number_of<std::uint64_t>(after);
  if ((!before.empty() && !first) || (!after.empty() && !last) || (!first && !last) ||
      (first && last && *last < *first)) {
    return std::nullopt;  // several ranges or bad syntax
  }
  const std::uint64_t begin = first ? *first : size - std::min(size, *last);
  const std::uint64_t end = first && last ? std::min(size - 1, *last) : size - 1;
  if (size == 0 || begin >= size || (!first && *last == 0)) {
    throw Error(ErrorCode::kRangeNotSatisfiable, "the file has " + std::to_string(size) + " bytes");
  }
  return ByteRange{begin, end - begin + 1};
}

bool accepts_gzip(const httplib::Request& request) {
  const std::string header = request.get_header_value("Accept-Encoding");
  for (const std::string_view coding : split(header, ',')) {
    const std::vector<std::string_view> parts = split(coding, ';');
    if (parts[0] != "gzip" && parts[0] != "*") continue;
    const bool weighed = parts.size() > 1 && parts[1].starts_with("q=");
    return !weighed || number_of<double>(parts[1].substr(2)).value_or(1) > 0;
  }
  return false;
}

bool matches_etag(const httplib::Request& request, std::string_view etag) {
  return names_etag(request.get_header_value("If-None-Match"), etag);
}

void check_if_match(const httplib::Request& request, std::string_view etag) {
  if (!request.has_header("If-Match")) return;
  if (names_etag(request.get_header_value("If-Match"), etag)) return;
  throw Error(ErrorCode::kPreconditionFailed, "what If-Match names is not what is there");
}

std::string cursor_after(std::string_view kind, std::string_view id) {
  const std::string text = std::string(kind) + ':' + std::string(id);
  return store::to_hex({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

std::string id_after(const httplib::Request& request, std::string_view kind) {
  if (!request.has_param("cursor")) return {};
  const std::string cursor = request.get_param_value("cursor");
  const bool is_hex =
      cursor.size() % 2 == 0 && cursor.find_first_not_of("0123456789abcdef") == std::string::npos;
  std::string text;
  for (std::size_t i = 0; is_hex && i < cursor.size(); i += 2) {
    text += static_cast<char>(nibble(cursor[i]) << 4 | nibble(cursor[i + 1]));
  }
  constexpr std::size_t kLongest = 128;
  const std::string prefix = std::string(kind) + ':';
  const bool is_ours = text.size() > prefix.size() && text.size() <= kLongest &&
                       text.starts_with(prefix) &&
                       std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
  if (!is_ours) throw wrong_cursor();
  return text.substr(prefix.size());
}

Error wrong_cursor() {
  return invalid_parameter("cursor", "must be the `next` of another page of this list");
}

std::optional<std::uint64_t> last_event_id(const httplib::Request& request) {
  if (!request.has_header("Last-Event-ID")) return std::nullopt;
  const auto number = number_of<std::uint64_t>(request.get_header_value("Last-Event-ID"));
  if (!number)
    throw invalid_parameter("Last-Event-ID", "must be the id of an event of this stream");
  constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();  // the store's
  return std::min(*number, kLargest);
}

}  // namespace isomesh::http
