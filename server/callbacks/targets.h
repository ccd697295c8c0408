// Where jobs may call back to. The addresses come from clients, and the daemon stands inside a
// network that they do not: only what its operator listed is called, and a listed name does not
// lead to a private address unless its entry says so.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sys/socket.h>

#include "proto/error.h"

namespace isomesh::callbacks {

// What a name that stands in the list may resolve to.
enum class Reach {
  kPublic,   // public addresses alone
  kPrivate,  // private networks and this machine too; never link-local ones, where clouds keep
             // their credentials
  kAny,      // the entry names the address itself
};

// Constant after construction.
class CallbackTargets {
 public:
  // Each entry is the beginning of allowed URLs: http or https, a host, a port where it is not the
  // scheme's, and perhaps a path, whose last part must match whole. `private:` before an entry lets
  // its name lead to private addresses. Throws Error kInvalidParameter that names the entry.
  explicit CallbackTargets(const std::vector<std::string>& allowed);

  bool empty() const { return entries_.empty(); }

  // Throws Error kInvalidParameter for the field `callback.url` when the URL is malformed or not
  // allowed.
  void check(const std::string& url) const;

  // How far the URL may reach; empty when it is not allowed (any more).
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
    std::string read_path;  // as the most forgiving server may read it
  };
  struct Entry {
    Url url;
    Reach reach = Reach::kPublic;
  };
  std::vector<Entry> entries_;
};

// Whether a connection to that address is within reach.
bool is_within(Reach reach, const sockaddr& address);

}  // namespace isomesh::callbacks
