// Requests for tests that look at nothing but a part of them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/http/requests/request.h"

namespace isomesh::test {

inline http::Request with_query(
    const std::vector<std::pair<std::string, std::string>>& parameters) {
  http::Request request;
  request.query = parameters;
  return request;
}

}  // namespace isomesh::test
