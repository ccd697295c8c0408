// Restricts the pages that may use the service from a browser, and the names of the service.
//
// A daemon on loopback without tokens trusts every local process. That includes every page in a
// local browser, unless the daemon checks two headers that pages cannot forge: Origin, the page's
// origin, and Host, the server's name in the browser, which is a foreign name after DNS rebinding.
#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.h"
#include "server/http/requests/request.h"
#include "server/http/requests/response.h"

namespace isomesh::http {

struct OriginRules {
  // Origins of other pages that may read responses: `https://viewer.example`, or `*` for all.
  std::vector<std::string> cors_origins;
  // If true, Host must be a name of loopback or one of `hosts`.
  bool check_host = false;
  std::vector<std::string> hosts;  // without ports
};

// The origin of pages at that address as a browser sends it: scheme, host and port, in lower case
// and without a port that the scheme implies. Without a scheme, https is assumed. Empty if it is no
// address of a page.
std::string origin_of(std::string_view address);

// The host of an authority such as `localhost:8080` or `[::1]:8080`, in lower case; empty if
// invalid.
std::string host_of(std::string_view authority);

// The host that a setting names, as host_of returns it from a request: with or without a port, and
// an IPv6 address with or without brackets. Empty if it names none.
std::string host_named(const std::string& setting);

// Logs each origin once, up to a number of them: pages that the rules do not allow. Thread safe.
class RefusedOrigins {
 public:
  void tell(std::string_view origin) ISOMESH_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  std::set<std::string, std::less<>> told_ ISOMESH_GUARDED_BY(mutex_);
};

// True if the request comes from a page that is neither the server's nor allowed. Such a page
// cannot read the response, and check_origin rejects its modifying requests.
bool is_of_foreign_page(const OriginRules& rules, const Request& request);

// Throws Error kForbidden for a foreign Host, and for a modifying request of a page that is not
// allowed.
void check_origin(const OriginRules& rules, const Request& request);

// Sets the CORS headers that let an allowed page read the response.
void allow_reading(const OriginRules& rules, const Request& request, Response& response);

bool is_preflight(const OriginRules& rules, const Request& request);

void answer_preflight(const std::string& methods, Response& response);

}  // namespace isomesh::http
