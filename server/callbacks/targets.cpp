#include "server/callbacks/targets.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string_view>

#include <arpa/inet.h>
#include <curl/curl.h>
#include <netinet/in.h>

#include "base/hex.h"
#include "base/text.h"
#include "server/callbacks/limits.h"

namespace isomesh::callbacks {
namespace {

using CurlUrl = std::unique_ptr<CURLU, decltype(&curl_url_cleanup)>;

// Uses the same URL parser as the connection: differing parsers are a way around such lists.
std::optional<std::string> part_of(const CurlUrl& url, CURLUPart part, unsigned flags = 0) {
  char* text = nullptr;
  if (curl_url_get(url.get(), part, &text, flags) != CURLUE_OK) return std::nullopt;
  std::string result(text);
  curl_free(text);
  return result;
}

// True for paths that servers may interpret differently.
bool is_ambiguous(const std::string& path) {
  const std::string text = lower(path);
  for (const std::string_view trick : {"%2e", "%2f", "%5c", "\\", "/../", "/./", "//"}) {
    if (text.find(trick) != std::string::npos) return true;
  }
  return text.ends_with("/..") || text.ends_with("/.");
}

std::optional<std::string> decoded(const std::string& text) {
  std::string result;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] != '%') {
      result += text[at];
      continue;
    }
    const auto byte = from_hex(lower(text.substr(at + 1, 2)));
    if (!byte || byte->size() != 1 || static_cast<unsigned char>(byte->front()) < ' ') {
      return std::nullopt;
    }
    result += *byte;
    at += 2;
  }
  return result;
}

// Removes parameters, as Java servers do: the text after a semicolon in each segment.
std::string without_parameters(const std::string& path) {
  std::string result;
  bool is_parameter = false;
  for (const char c : path) {
    is_parameter = c == ';' || (is_parameter && c != '/');
    if (!is_parameter) result += c;
  }
  return result;
}

// The path as the most lenient chain of servers may read it: decoded repeatedly, without
// parameters. Empty if it is ambiguous.
std::optional<std::string> as_read(std::string path) {
  constexpr int kMostDecodings = 4;
  for (int n = 0; n < kMostDecodings; ++n) {
    if (is_ambiguous(path) || is_ambiguous(without_parameters(path))) return std::nullopt;
    if (path.find('%') == std::string::npos) return without_parameters(path);
    const auto next = decoded(path);
    if (!next) return std::nullopt;
    path = *next;
  }
  return std::nullopt;
}

bool lies_below(const std::string& path, const std::string& prefix) {
  return path.starts_with(prefix) &&
         (prefix.ends_with('/') || path.size() == prefix.size() || path[prefix.size()] == '/');
}

bool is_address(const std::string& host) {
  in_addr v4 = {};
  return host.starts_with('[') || ::inet_pton(AF_INET, host.c_str(), &v4) == 1;
}

struct Network {
  std::uint32_t address;
  int bits;
};

bool holds(const Network& network, std::uint32_t address) {
  constexpr int kAddressBits = 32;
  return (address ^ network.address) >> (kAddressBits - network.bits) == 0;
}

// From IANA's registry of special addresses: networks of an organisation's own machines.
constexpr std::array kPrivateNetworks = {Network{0x0A000000, 8},     // 10.0.0.0
                                         Network{0xAC100000, 12},    // 172.16.0.0
                                         Network{0xC0A80000, 16},    // 192.168.0.0
                                         Network{0x64400000, 10},    // 100.64.0.0
                                         Network{0x7F000000, 8}};    // 127.0.0.0
constexpr std::array kForbiddenNetworks = {Network{0x00000000, 8},   // "this network"
                                           Network{0xA9FE0000, 16},  // 169.254.0.0, link-local
                                           Network{0xC0000000, 24},  // 192.0.0.0, protocols
                                           Network{0xC6120000, 15},  // 198.18.0.0, benchmarks
                                           Network{0xE0000000, 3}};  // multicast and above

bool is_within_v4(Reach reach, std::uint32_t address) {
  const auto in = [&](const Network& network) { return holds(network, address); };
  if (std::ranges::any_of(kForbiddenNetworks, in)) return false;
  return reach == Reach::kPrivate || std::ranges::none_of(kPrivateNetworks, in);
}

std::uint32_t v4_at(const in6_addr& address, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, address.s6_addr + offset, sizeof value);
  return ntohl(value);
}

bool is_within_v6(Reach reach, const in6_addr& address) {
  const std::uint8_t* bytes = address.s6_addr;
  constexpr std::array<std::uint8_t, 12> kNat64 = {0, 0x64, 0xFF, 0x9B};
  if (IN6_IS_ADDR_V4MAPPED(&address) || std::equal(kNat64.begin(), kNat64.end(), bytes)) {
    return is_within_v4(reach, v4_at(address, 12));
  }
  const bool is_6to4 = bytes[0] == 0x20 && bytes[1] == 0x02;
  if (is_6to4) return is_within_v4(reach, v4_at(address, 2));
  const bool is_unique_local = (bytes[0] & 0xFE) == 0xFC;
  if (IN6_IS_ADDR_LOOPBACK(&address) || is_unique_local) return reach == Reach::kPrivate;
  const bool is_global = (bytes[0] & 0xE0) == 0x20;  // 2000::/3, the assigned addresses
  return is_global;
}

}  // namespace

std::optional<CallbackTargets::Url> CallbackTargets::parse(const std::string& text) {
  const bool printable =
      std::ranges::all_of(text, [](unsigned char c) { return c > ' ' && c < 0x7F; });
  if (text.empty() || text.size() > limits::kLongestUrl || !printable) return std::nullopt;
  const CurlUrl url(curl_url(), &curl_url_cleanup);
  if (!url || curl_url_set(url.get(), CURLUPART_URL, text.c_str(), 0) != CURLUE_OK) {
    return std::nullopt;
  }
  const auto scheme = part_of(url, CURLUPART_SCHEME);
  const auto host = part_of(url, CURLUPART_HOST);
  const auto port = part_of(url, CURLUPART_PORT, CURLU_DEFAULT_PORT);
  const auto path = part_of(url, CURLUPART_PATH);
  const bool has_more = part_of(url, CURLUPART_USER) || part_of(url, CURLUPART_PASSWORD) ||
                        part_of(url, CURLUPART_FRAGMENT) || part_of(url, CURLUPART_ZONEID);
  if (!scheme || !host || !port || !path || has_more ||
      is_ambiguous(text.substr(scheme->size() + 3))) {
    return std::nullopt;
  }
  if (*scheme != "http" && *scheme != "https") return std::nullopt;
  const auto read = as_read(*path);
  if (!read) return std::nullopt;
  return Url{*scheme, lower(*host), *port, *path, *read};
}

CallbackTargets::CallbackTargets(const std::vector<std::string>& allowed) {
  constexpr std::string_view kPrivatePrefix = "private:";
  for (const std::string& text : allowed) {
    const bool is_private = text.starts_with(kPrivatePrefix);
    const std::string prefix = is_private ? text.substr(kPrivatePrefix.size()) : text;
    const auto url = parse(prefix);
    if (!url || prefix.find('?') != std::string::npos) {
      throw invalid_parameter("callback-allow",
                              "\"" + text + "\" is not http[s]://HOST[:PORT][/PATH]");
    }
    Reach reach = is_private ? Reach::kPrivate : Reach::kPublic;
    if (is_address(url->host)) reach = Reach::kAny;
    entries_.push_back({*url, reach});
  }
}

std::optional<Reach> CallbackTargets::reach_of(const std::string& text) const {
  const auto url = parse(text);
  if (!url) return std::nullopt;
  for (const Entry& entry : entries_) {
    const bool path_begins =
        lies_below(url->path, entry.url.path) && lies_below(url->read_path, entry.url.read_path);
    if (url->scheme == entry.url.scheme && url->host == entry.url.host &&
        url->port == entry.url.port && path_begins) {
      return entry.reach;
    }
  }
  return std::nullopt;
}

void CallbackTargets::check(const std::string& url) const {
  constexpr const char* kField = "callback.url";
  if (!parse(url)) {
    throw invalid_parameter(kField, "must be a plain http or https URL of at most 2000 bytes");
  }
  if (!reach_of(url)) {
    throw invalid_parameter(
        kField, "is not among the addresses that this service may call (--callback-allow)");
  }
}

bool is_within(Reach reach, const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    sockaddr_in v4 = {};
    std::memcpy(&v4, &address, sizeof v4);
    return reach == Reach::kAny || is_within_v4(reach, ntohl(v4.sin_addr.s_addr));
  }
  if (address.sa_family == AF_INET6) {
    sockaddr_in6 v6 = {};
    std::memcpy(&v6, &address, sizeof v6);
    return reach == Reach::kAny || is_within_v6(reach, v6.sin6_addr);
  }
  return false;
}

}  // namespace isomesh::callbacks
