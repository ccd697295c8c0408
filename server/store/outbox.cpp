#include "server/store/outbox.h"

namespace isomesh::store {

std::string receiver_of(const std::string& url) {
  const std::size_t host = url.find("://");
  return url.substr(0, host == std::string::npos ? host : url.find_first_of("/?#", host + 3));
}

}  // namespace isomesh::store
