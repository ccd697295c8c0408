#include "server/net/request_head.h"

#include <algorithm>
#include <charconv>

#include <strings.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh::net {
namespace {

Error malformed(const std::string& what) {
  return {ErrorCode::kInvalidParameter, "the request is malformed: " + what};
}

// A method or the name of a header.
bool is_token(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, is_token_character);
}

// Absolute targets are for proxies, but servers must accept them.
std::string path_and_query(std::string_view target) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!equal_names(target.substr(0, scheme.size()), scheme)) continue;
    const std::size_t begin = target.find_first_of("/?", scheme.size());
    if (begin == std::string_view::npos) return "/";
    return target[begin] == '?' ? '/' + std::string(target.substr(begin))
                                : std::string(target.substr(begin));
  }
  return std::string(target);
}

void parse_request_line(std::string_view line, RequestHead& head) {
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == std::string_view::npos || first == last) {
    throw malformed("it does not begin with a method, a target and a version");
  }
  head.method = line.substr(0, first);
  head.version = line.substr(last + 1);
  const std::string_view target = line.substr(first + 1, last - first - 1);
  if (!is_token(head.method)) throw malformed("its method is not valid");
  if (head.version != "HTTP/1.1" && head.version != "HTTP/1.0") {
    throw malformed("its version is neither HTTP/1.1 nor HTTP/1.0");
  }
  const bool printable =
      std::ranges::all_of(target, [](char c) { return c > 0x20 && c < 0x7F && c != '#'; });
  head.target = path_and_query(target);
  if (!printable || (!head.target.starts_with('/') && head.target != "*")) {
    throw malformed("its target is not a path");
  }
}

void parse_header(std::string_view line, RequestHead& head) {
  const std::size_t colon = line.find(':');
  const std::string_view name = line.substr(0, colon);
  // Parsers differ on a blank before the colon and on continuation lines.
  if (colon == std::string_view::npos || !is_token(name)) {
    throw malformed("a header has no name");
  }
  if (head.headers.size() == kMostHeaders) {
    throw Error(ErrorCode::kHeadersTooLarge,
                "the request has more than " + std::to_string(kMostHeaders) + " headers");
  }
  head.headers.emplace_back(name, trimmed(line.substr(colon + 1)));
}

void check_host(const RequestHead& head) {
  const auto hosts = std::ranges::count_if(
      head.headers, [](const auto& header) { return equal_names(header.first, "Host"); });
  if (hosts > 1 || (hosts == 0 && head.version == "HTTP/1.1")) {
    throw invalid_parameter("Host", "must be given once");
  }
}

}  // namespace

bool equal_names(std::string_view a, std::string_view b) {
  return a.size() == b.size() && ::strncasecmp(a.data(), b.data(), a.size()) == 0;
}

bool is_token_character(char c) {
  constexpr std::string_view kOthers = "!#$%&'*+-.^_`|~";
  return is_letter_or_digit(c) || kOthers.find(c) != std::string_view::npos;
}

bool is_control(char c) { return (static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7F; }

const std::string* find_header(const Headers& headers, std::string_view name) {
  const auto found = std::ranges::find_if(
      headers, [&](const auto& header) { return equal_names(header.first, name); });
  return found == headers.end() ? nullptr : &found->second;
}

std::optional<std::size_t> HeadScanner::scan(std::string_view received) {
  for (; scanned_ < received.size(); ++scanned_) {
    const char c = received[scanned_];
    const std::size_t length = scanned_ - line_begin_;
    if (length >= kLongestLine) {
      if (!has_request_line_) throw Error(ErrorCode::kUriTooLong, "the request line is too long");
      throw Error(ErrorCode::kHeadersTooLarge,
                  "a header is longer than " + std::to_string(kLongestLine) + " bytes");
    }
    if (scanned_ >= kLongestHead) {
      throw Error(ErrorCode::kHeadersTooLarge,
                  "the headers are longer than " + std::to_string(kLongestHead) + " bytes");
    }
    if (c != '\n') {
      const bool after_return = length > 0 && received[scanned_ - 1] == '\r';
      if (after_return || (is_control(c) && c != '\r'))
        throw malformed("it contains a control character");
      continue;
    }
    if (length == 0 || received[scanned_ - 1] != '\r')
      throw malformed("a line does not end with CR and LF");
    const bool is_empty = length == 1;
    line_begin_ = scanned_ + 1;
    if (is_empty && has_request_line_) return ++scanned_;
    has_request_line_ = has_request_line_ || !is_empty;  // empty lines may precede it
  }
  return std::nullopt;
}

RequestHead parse_head(std::string_view bytes) {
  constexpr std::string_view kEnd = "\r\n";
  RequestHead head;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find(kEnd), bytes.size());
    const std::string_view line = bytes.substr(0, end);
    bytes.remove_prefix(std::min(end + kEnd.size(), bytes.size()));
    if (line.empty()) continue;  // before the request line, or at the end
    if (head.method.empty()) {
      parse_request_line(line, head);
    } else {
      parse_header(line, head);
    }
  }
  check_host(head);
  return head;
}

BodyFraming framing_of(const RequestHead& head) {
  BodyFraming framing;
  for (const auto& [name, value] : head.headers) {
    if (equal_names(name, "Content-Length")) {
      std::uint64_t length = 0;
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), length);
      const bool is_number = error == std::errc() && end == value.data() + value.size();
      if (framing.length || !is_number) {
        throw invalid_parameter("Content-Length", "must be one whole number");
      }
      framing.length = length;
    } else if (equal_names(name, "Transfer-Encoding")) {
      if (framing.chunked || !equal_names(value, "chunked") || head.version == "HTTP/1.0") {
        throw invalid_parameter("Transfer-Encoding", "must be \"chunked\"");
      }
      framing.chunked = true;
    }
  }
  if (framing.chunked && framing.length) {
    throw invalid_parameter("Transfer-Encoding", "cannot be combined with Content-Length");
  }
  return framing;
}

}  // namespace isomesh::net
