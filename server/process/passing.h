// Passes descriptors to another process over a Unix socket (SCM_RIGHTS).
#pragma once

#include <span>
#include <string_view>

#include <sys/types.h>

#include "base/descriptor.h"

namespace isomesh::process {

// Sends a prefix of `bytes`, at least one byte, with a descriptor, which the caller keeps. Returns
// the number of bytes, or -1 with errno.
ssize_t send_with(int socket, std::string_view bytes, int passed);

// The result of recv(), and the descriptor received, if any.
struct Received {
  ssize_t count = -1;
  Descriptor passed;
};
Received receive(int socket, std::span<char> target);

}  // namespace isomesh::process
