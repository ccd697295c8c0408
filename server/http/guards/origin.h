// Which pages may use the service from a browser, and under which names it is reached.
//
// A daemon on loopback without tokens trusts whoever can connect. So can every page in a browser on
// the same machine, unless the daemon looks at the two headers that pages cannot forge: Origin,
// which names the page, and Host, which names the server that the browser believes to talk to and
// which is somebody else's name after DNS rebinding.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/http/requests/request.h"
#include "server/http/requests/response.h"

namespace isomesh::http {

struct OriginRules {
  // Pages of other origins that may read answers: `https://viewer.example`, or `*` for all.
  std::vector<std::string> cors_origins;
  // Host is checked when this is true: then it must be a name of loopback or one of `hosts`.
  bool check_host = false;
  std::vector<std::string> hosts;  // without ports
};

// The host of an authority such as `localhost:8080` or `[::1]:8080`, in lower case; empty when it
// is none.
std::string host_of(std::string_view authority);

// Throws Error kForbidden for a Host that is not ours, and for a request that changes something
// from a page that may not.
void check_origin(const OriginRules& rules, const Request& request);

// Sets the headers by which a browser lets an allowed page read the answer.
void allow_reading(const OriginRules& rules, const Request& request, Response& response);

// Whether the request only asks, for an allowed page, what it may do.
bool is_preflight(const OriginRules& rules, const Request& request);

// Answers that `methods` (with commas between) may be used.
void answer_preflight(const std::string& methods, Response& response);

}  // namespace isomesh::http
