// Encodes URLs and parses server addresses.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh {

struct ServerAddress {
  std::string origin;                 // scheme, host and optional port: the prefix of URLs
  std::filesystem::path socket = {};  // a local socket; empty: the origin's host and port

  bool operator==(const ServerAddress&) const = default;
};

// Parses `http://HOST[:PORT]`, `https://HOST[:PORT]` (IPv6 in brackets; one trailing slash is
// ignored) or `unix:PATH`. Throws Error kInvalidParameter for anything else.
ServerAddress parse_server_address(std::string_view url);

// Encodes a segment of a path. Throws Error kInvalidParameter for text that is not an identifier
// and would name another resource: empty, ".", ".." and text with a slash.
std::string path_segment(std::string_view text);

// `?a=1&b=2` with encoded names and values; empty without pairs.
std::string query_string(const std::vector<std::pair<std::string, std::string>>& pairs);

}  // namespace isomesh
