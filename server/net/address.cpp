#include "server/net/address.h"

#include <algorithm>
#include <string_view>

#include <arpa/inet.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh::net {

bool Address::is_loopback() const {
  if (is_unix() || host == "localhost" || host == "::1") return true;
  in_addr v4 = {};
  constexpr std::uint32_t kLoopbackNetwork = 127;
  return ::inet_pton(AF_INET, host.c_str(), &v4) == 1 && ntohl(v4.s_addr) >> 24 == kLoopbackNetwork;
}

Address parse_address(const std::string& text) {
  constexpr std::string_view kUnix = "unix:";
  if (text.starts_with(kUnix)) {
    const std::string path = text.substr(kUnix.size());
    constexpr std::size_t kLongestSocketPath = 107;  // what sockaddr_un holds
    if (path.empty() || path.size() > kLongestSocketPath) {
      throw invalid_parameter("listen", "a socket's path has 1 to 107 bytes");
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
