// Restricts the URLs of callbacks. Clients choose them, and the daemon is inside a network that
// clients cannot reach. Only URLs in the operator's list are called, and names lead to private
// addresses only if their entry permits it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sys/socket.h>

#include "proto/error.h"

namespace isomesh::callbacks {

// The addresses that a listed name may resolve to.
enum class Reach {
  kPublic,   // only public addresses
  kPrivate,  // also private networks and this machine; never link-local ones, where clouds keep
             // their credentials
  kAny,      // any; the entry is an address itself
};

// Constant after construction.
class CallbackTargets {
 public:
  // Each entry is the prefix of allowed URLs: http or https, a host, a port if it is not the
  // default, and optionally a path, whose last segment must match completely. Prefix an entry with
  // `private:` to allow private addresses. Throws Error kInvalidParameter with the entry.
  explicit CallbackTargets(const std::vector<std::string>& allowed);

  bool empty() const { return entries_.empty(); }

  // Throws Error kInvalidParameter for the field `callback.url` if the URL is malformed or not
  // allowed.
  void check(const std::string& url) const;

  // The permitted addresses of the URL; empty if it is not allowed (any more).
  std::optional<Reach> reach_of(const std::string& url) const;

 private:
  struct Entry;
  struct Url;

  static std::optional<Url> parse(const std::string& url);

  struct Url {
    std::string scheme;
    std::string host;
    std::string port;
    std::string path;
    std::string read_path;  // as the most lenient server may read it
  };
  struct Entry {
    Url url;
    Reach reach = Reach::kPublic;
  };
  std::vector<Entry> entries_;
};

// True if a connection to the address is permitted.
bool is_within(Reach reach, const sockaddr& address);

}  // namespace isomesh::callbacks
