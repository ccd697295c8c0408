// Connections to others.
#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>
#include <string>

#include "base/descriptor.h"

namespace isomesh::net {

// A connection whose reads and writes wait, and that does not wait for further bytes before it
// sends (TCP_NODELAY). Throws Error kUnreachable, kRequestTimeout when there is none within that
// time, and kCancelled when `stop` is requested.
Descriptor connect_to(const std::string& host, std::uint16_t port, std::chrono::seconds timeout,
                      const std::stop_token& stop);

}  // namespace isomesh::net
