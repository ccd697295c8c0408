// Addresses to listen on, and of peers.
#pragma once

#include <filesystem>
#include <string>

#include <sys/socket.h>

namespace isomesh::net {

// HOST:PORT (port 0: a free one) or unix:PATH.
struct Address {
  std::string host;
  int port = 0;
  std::filesystem::path unix_path;  // empty for TCP

  bool is_unix() const { return !unix_path.empty(); }
  // True if only this machine can connect. Names other than localhost count as reachable from
  // elsewhere, whatever they resolve to.
  bool is_loopback() const;
};

// The party that shares limits (FairPlaces): an IPv4 address, or an IPv6 network of 64 bits, the
// smallest that providers assign. `address` is numeric; "" for "".
std::string party_of(const std::string& address);

// The numeric address of an IP socket's peer; "" for others.
std::string address_of(const sockaddr_storage& peer);

// Throws Error kInvalidParameter with the reason.
Address parse_address(const std::string& text);

}  // namespace isomesh::net
