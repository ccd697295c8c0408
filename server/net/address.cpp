#include "server/net/address.h"

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

#include <arpa/inet.h>

#include "base/hex.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::net {

bool Address::is_loopback() const {
  if (is_unix() || host == "localhost" || host == "::1") return true;
  in_addr v4 = {};
  constexpr std::uint32_t kLoopbackNetwork = 127;
  return ::inet_pton(AF_INET, host.c_str(), &v4) == 1 && ntohl(v4.s_addr) >> 24 == kLoopbackNetwork;
}

std::string party_of(const std::string& address) {
  in6_addr v6 = {};
  if (::inet_pton(AF_INET6, address.c_str(), &v6) != 1) return address;
  constexpr std::size_t kNetworkBytes = 8;
  constexpr std::size_t kV4Offset = 12;
  const std::span<const std::uint8_t> bytes(v6.s6_addr);
  std::array<char, INET_ADDRSTRLEN> v4 = {};
  if (IN6_IS_ADDR_V4MAPPED(&v6)) {
    return ::inet_ntop(AF_INET, &bytes[kV4Offset], v4.data(), v4.size());
  }
  return to_hex(bytes.first(kNetworkBytes));
}

std::string address_of(const sockaddr_storage& peer) {
  std::array<char, INET6_ADDRSTRLEN> text = {};
  const void* address = nullptr;
  if (peer.ss_family == AF_INET) {
    address = &reinterpret_cast<const sockaddr_in&>(peer).sin_addr;
  } else if (peer.ss_family == AF_INET6) {
    address = &reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr;
  }
  if (address == nullptr ||
      ::inet_ntop(peer.ss_family, address, text.data(), text.size()) == nullptr) {
    return {};
  }
  return text.data();
}

Address parse_address(const std::string& text) {
  constexpr std::string_view kUnix = "unix:";
  if (text.starts_with(kUnix)) {
    const std::string path = text.substr(kUnix.size());
    constexpr std::size_t kLongestSocketPath = 107;  // the size of sockaddr_un's path
    if (path.empty() || path.size() > kLongestSocketPath) {
      throw invalid_parameter("listen", "the path of a socket must have 1 to 107 bytes");
    }
    return {.host = "", .port = 0, .unix_path = path};
  }
  constexpr std::uint64_t kLargestPort = 65535;
  const std::size_t colon = text.rfind(':');
  std::string host = text.substr(0, std::min(colon, text.size()));
  const auto port = parse_uint64(colon == std::string::npos ? "" : text.substr(colon + 1));
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (host.empty() || !port || text[colon + 1] == '+' || *port > kLargestPort) {
    throw invalid_parameter("listen", "must be HOST:PORT or unix:PATH");
  }
  return {.host = host, .port = static_cast<int>(*port), .unix_path = {}};
}

}  // namespace isomesh::net
