#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>
#include <string>

#include "base/descriptor.h"

namespace isomesh::net {

// Connects a blocking socket without send delay (TCP_NODELAY). Throws Error kUnreachable,
// kRequestTimeout after `timeout`, and kCancelled if `stop` is requested.
Descriptor connect_to(const std::string& host, std::uint16_t port, std::chrono::seconds timeout,
                      const std::stop_token& stop);

}  // namespace isomesh::net
