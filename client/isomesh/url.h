// What is put into URLs, and where a server is.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh {

// Where a server listens.
struct ServerAddress {
  std::string origin;                 // scheme, host and perhaps a port: what URLs begin with
  std::filesystem::path socket = {};  // of this machine; empty: the origin's host and port

  bool operator==(const ServerAddress&) const = default;
};

// Reads `http://HOST[:PORT]`, `https://HOST[:PORT]` (IPv6 in brackets; one closing slash is
// ignored) or `unix:PATH`. Throws Error kInvalidParameter for anything else.
ServerAddress parse_server_address(std::string_view url);

// `text` with every byte that is not unreserved in RFC 3986 as %XX.
std::string percent_encode(std::string_view text);

// One segment of a path. Throws Error kInvalidParameter for text that no identifier is and that
// would name another resource: nothing, "." and "..".
std::string path_segment(std::string_view text);

// `?a=1&b=2` with names and values encoded, empty when there are no pairs.
std::string query_string(const std::vector<std::pair<std::string, std::string>>& pairs);

}  // namespace isomesh
