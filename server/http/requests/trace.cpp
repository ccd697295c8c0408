#include "server/http/requests/trace.h"

#include <algorithm>

#include "base/ids.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kTraceDigits = 32;
constexpr std::size_t kSpanDigits = 16;

bool is_hex(std::string_view text) {
  return std::ranges::all_of(
      text, [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

bool is_zero(std::string_view text) {
  return std::ranges::all_of(text, [](char c) { return c == '0'; });
}

// VERSION-TRACE-PARENT-FLAGS (W3C Trace Context, 3.2). Later versions may append more.
bool is_valid(std::string_view header) {
  constexpr std::size_t kLength = 2 + 1 + kTraceDigits + 1 + kSpanDigits + 1 + 2;
  if (header.size() < kLength) return false;
  const std::string_view version = header.substr(0, 2);
  const std::string_view trace = header.substr(3, kTraceDigits);
  const std::string_view parent = header.substr(4 + kTraceDigits, kSpanDigits);
  const std::string_view flags = header.substr(5 + kTraceDigits + kSpanDigits, 2);
  const bool ends = version == "00" ? header.size() == kLength
                                    : header.size() == kLength || header[kLength] == '-';
  return ends && version != "ff" && header[2] == '-' && header[3 + kTraceDigits] == '-' &&
         header[4 + kTraceDigits + kSpanDigits] == '-' && is_hex(version) && is_hex(trace) &&
         is_hex(parent) && is_hex(flags) && !is_zero(trace) && !is_zero(parent);
}

}  // namespace

Trace continue_trace(std::string_view traceparent) {
  const std::string random = random_hex((kTraceDigits + kSpanDigits) / 2);
  return {is_valid(traceparent) ? std::string(traceparent.substr(3, kTraceDigits))
                                : random.substr(0, kTraceDigits),
          random.substr(kTraceDigits)};
}

}  // namespace isomesh::http
