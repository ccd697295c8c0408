#include "server/http/guards/proxies.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh::http {
namespace {

constexpr std::string_view kUnix = "unix";
constexpr unsigned kAddressBits = 128;
constexpr unsigned kBitsBeforeV4 = 96;
constexpr unsigned kByteBits = 8;

using AddressBytes = std::array<std::uint8_t, 16>;

struct ParsedAddress {
  AddressBytes bytes = {};
  bool is_v4 = false;
};

std::optional<ParsedAddress> parsed(const std::string& text) {
  constexpr std::size_t kMark = 10;  // of mapped addresses: two bytes of ones before the IPv4
  ParsedAddress address;
  if (::inet_pton(AF_INET6, text.c_str(), address.bytes.data()) == 1) return address;
  if (::inet_pton(AF_INET, text.c_str(), &address.bytes[kBitsBeforeV4 / kByteBits]) != 1) {
    return std::nullopt;
  }
  address.bytes[kMark] = address.bytes[kMark + 1] = 0xff;
  address.is_v4 = true;
  return address;
}

// Of a node such as 192.0.2.1, 192.0.2.1:80, [2001:db8::1]:80 or 2001:db8::1; empty for others,
// such as `unknown`.
std::string address_in(std::string_view node) {
  if (node.starts_with('[')) {
    const std::size_t end = node.find(']');
    if (end == std::string_view::npos) return "";
    node = node.substr(1, end - 1);
  } else if (std::ranges::count(node, ':') == 1) {
    node = node.substr(0, node.find(':'));
  }
  std::string address(node);
  return parsed(address) ? address : "";
}

// The value of `for` in an element of Forwarded (RFC 7239, 4).
std::string_view node_in(std::string_view element) {
  constexpr std::string_view kFor = "for=";
  for (std::string_view pair : split(element, ';')) {
    if (lower(pair.substr(0, kFor.size())) != kFor) continue;
    pair.remove_prefix(kFor.size());
    if (pair.size() >= 2 && pair.front() == '"' && pair.back() == '"') {
      pair = pair.substr(1, pair.size() - 2);
    }
    return pair;
  }
  return "";
}

bool share_bits(const AddressBytes& one, const AddressBytes& other, unsigned bits) {
  const unsigned whole = bits / kByteBits;
  if (!std::equal(one.begin(), one.begin() + whole, other.begin())) return false;
  const unsigned rest = bits % kByteBits;
  return rest == 0 || (one[whole] ^ other[whole]) >> (kByteBits - rest) == 0;
}

}  // namespace

TrustedProxies::TrustedProxies(const std::vector<std::string>& networks, ClientHeader header)
    : header_(header) {
  for (const std::string& network : networks) {
    if (network == kUnix) {
      trusts_unix_ = true;
    } else {
      networks_.push_back(network_from(network));
    }
  }
}

TrustedProxies::Network TrustedProxies::network_from(std::string_view text) {
  const std::size_t slash = text.find('/');
  const auto address = parsed(std::string(text.substr(0, slash)));
  if (address) {
    const unsigned before = address->is_v4 ? kBitsBeforeV4 : 0;
    if (slash == std::string_view::npos) return {address->bytes, kAddressBits};
    const auto bits = parse_uint64(text.substr(slash + 1));
    if (bits && *bits <= kAddressBits - before) {
      return {address->bytes, before + static_cast<unsigned>(*bits)};
    }
  }
  throw invalid_parameter("trusted-proxy",
                          "must be an address, a network such as 10.1.0.0/16, or unix");
}

bool TrustedProxies::is_proxy(const std::string& address) const {
  if (address.empty()) return trusts_unix_;
  const auto its = parsed(address);
  return its && std::ranges::any_of(networks_, [&](const Network& network) {
           return share_bits(its->bytes, network.address, network.bits);
         });
}

std::string TrustedProxies::client_of(const Request& request) const {
  const std::string_view name =
      header_ == ClientHeader::kForwarded ? "Forwarded" : "X-Forwarded-For";
  std::vector<std::string_view> nodes;
  for (const auto& [key, value] : request.headers) {
    if (!net::equal_names(key, name)) continue;
    for (const std::string_view node : split(value, ',')) nodes.push_back(node);
  }
  std::string client = request.remote_address;
  for (auto node = nodes.rbegin(); node != nodes.rend() && is_proxy(client); ++node) {
    std::string next = address_in(header_ == ClientHeader::kForwarded ? node_in(*node) : *node);
    if (next.empty()) break;
    client = std::move(next);
  }
  return client;
}

}  // namespace isomesh::http
