// The addresses of clients behind reverse proxies.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/requests/request.h"

namespace isomesh::http {

// The header in which proxies name their clients. One only, because a proxy that sets one of them
// passes the other on as the client sent it.
enum class ClientHeader { kXForwardedFor, kForwarded };

// Thread safe once constructed.
class TrustedProxies {
 public:
  TrustedProxies() = default;
  // Each is an address, a network such as 10.1.0.0/16, or `unix` for the clients of the daemon's
  // Unix socket. Throws Error kInvalidParameter.
  TrustedProxies(const std::vector<std::string>& networks, ClientHeader header);

  // The address of the request's client: the last one in the header that is not of a proxy.
  // Whatever precedes it may be forged. The address of the connection if that is no proxy's, or if
  // the header names no address.
  std::string client_of(const Request& request) const;

 private:
  struct Network {
    std::array<std::uint8_t, 16> address = {};  // IPv6, or IPv4 mapped to it (RFC 4291, 2.5.5.2)
    unsigned bits = 0;
  };

  static Network network_from(std::string_view text);
  bool is_proxy(const std::string& address) const;

  std::vector<Network> networks_;
  bool trusts_unix_ = false;
  ClientHeader header_ = ClientHeader::kXForwardedFor;
};

}  // namespace isomesh::http
