// The one place where cpp-httplib is used. It decodes paths and queries, reads chunked bodies and
// forms, and compresses and writes responses. It neither listens nor reads heads, and knows one
// route: which request is whose is for Router to say.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/net/incoming_body.h"

namespace isomesh::http {

struct WrittenResponse {
  std::string bytes;  // all but what the response's stream makes
  std::uint64_t body_bytes =
      0;  // of the whole body, also of the stream's where its length is known
};

// Fills in the path and the query of the request, whose other members are given; calls `answer`,
// during which request.body can be read, and which fills in the response; and writes that. A target
// that the library refuses is answered with kInvalidParameter, without calling `answer`, which must
// not throw. Thread safe.
WrittenResponse pass_through_library(Request& request, net::IncomingBody& body, Response& response,
                                     const std::function<void()>& answer);

}  // namespace isomesh::http
