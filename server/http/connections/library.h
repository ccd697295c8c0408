// The only user of cpp-httplib. It decodes paths and queries, reads chunked bodies and forms, and
// compresses and writes responses. It does not listen or read heads, and knows one route; Router
// finds the request's route.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/net/incoming_body.h"

namespace isomesh::http {

struct WrittenResponse {
  std::string bytes;             // without the body of the response's stream
  std::uint64_t body_bytes = 0;  // of the whole body, including a stream of known length
};

// Sets the request's path and query from its other members. Calls `answer`, which may read
// request.body and fills in the response, and writes the response. If the library rejects the
// target, the response is kInvalidParameter and `answer` is not called. `answer` must not throw.
// Thread safe.
WrittenResponse pass_through_library(Request& request, net::IncomingBody& body, Response& response,
                                     const std::function<void()>& answer);

}  // namespace isomesh::http
