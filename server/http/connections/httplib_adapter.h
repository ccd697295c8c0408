// The only user of cpp-httplib. The library decodes paths and queries, reads forms, and compresses
// and writes responses (docs/decisions/own-connections.md). It does not listen or read heads and
// other bodies, and knows one route; Router finds the request's route.
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

// Sets the request's path and query from its other members. Calls `handle`, which may read
// request.body and fills in the response, and writes the response. If the library rejects the
// target, the response is kInvalidParameter and `handle` is not called. `handle` must not throw.
// Thread safe.
WrittenResponse run_through_httplib(Request& request, net::IncomingBody& body, Response& response,
                                    const std::function<void()>& handle);

}  // namespace isomesh::http
