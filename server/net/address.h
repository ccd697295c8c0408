// Addresses to listen on.
#pragma once

#include <filesystem>
#include <string>

namespace isomesh::net {

// HOST:PORT (port 0: a free one) or unix:PATH.
struct Address {
  std::string host;
  int port = 0;
  std::filesystem::path unix_path;  // empty for TCP

  bool is_unix() const { return !unix_path.empty(); }
  // Whether only this machine can reach it. A name other than localhost counts as reachable from
  // elsewhere, whatever it resolves to.
  bool is_loopback() const;
};

// Who shares limits (FairPlaces): whoever has one IPv4 address, or one network of 64 bits of IPv6,
// which is the least that is given out. `address` is a number; "" for "".
std::string party_of(const std::string& address);

// Throws Error kInvalidParameter that says what is wrong.
Address parse_address(const std::string& text);

}  // namespace isomesh::net
