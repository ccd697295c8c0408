#include "server/http/requests/request.h"

#include <algorithm>

#include "base/ids.h"
#include "base/text.h"

namespace isomesh::http {
namespace {

const std::string* find(const Parameters& parameters, std::string_view name) {
  const auto found = std::ranges::find(parameters, name, &Parameters::value_type::first);
  return found == parameters.end() ? nullptr : &found->second;
}

std::string_view text_of(const std::string* value) {
  return value == nullptr ? std::string_view() : *value;
}

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

bool Request::has_header(std::string_view name) const {
  return net::find_header(headers, name) != nullptr;
}

std::string_view Request::header(std::string_view name) const {
  return text_of(net::find_header(headers, name));
}

std::size_t Request::count_headers(std::string_view name) const {
  return static_cast<std::size_t>(std::ranges::count_if(
      headers, [&](const auto& header) { return net::equal_names(header.first, name); }));
}

bool Request::has_parameter(std::string_view name) const { return find(query, name) != nullptr; }

std::string_view Request::parameter(std::string_view name) const {
  return text_of(find(query, name));
}

std::size_t Request::count_parameters(std::string_view name) const {
  return static_cast<std::size_t>(std::ranges::count(query, name, &Parameters::value_type::first));
}

std::string Request::path_parameter(std::string_view name) const {
  return std::string(text_of(find(path_parameters, name)));
}

bool Request::has_body() const {
  return content_length.value_or(0) > 0 || has_header("Transfer-Encoding");
}

bool Request::is_form() const {
  return net::equal_names(split(header("Content-Type"), ';').front(), "multipart/form-data");
}

Trace continue_trace(std::string_view traceparent) {
  const std::string random = random_hex((kTraceDigits + kSpanDigits) / 2);
  return {is_valid(traceparent) ? std::string(traceparent.substr(3, kTraceDigits))
                                : random.substr(0, kTraceDigits),
          random.substr(kTraceDigits)};
}

std::string_view to_string(Role role) {
  switch (role) {
    case Role::kUser:
      return "user";
    case Role::kAdmin:
      return "admin";
    case Role::kMonitor:
      return "monitor";
  }
  return {};
}

std::optional<Role> role_from(std::string_view name) {
  for (const Role role : {Role::kUser, Role::kAdmin, Role::kMonitor}) {
    if (to_string(role) == name) return role;
  }
  return std::nullopt;
}

}  // namespace isomesh::http
