// Descriptors that go to another process, over a Unix socket (SCM_RIGHTS).
#pragma once

#include <span>
#include <string_view>

#include <sys/types.h>

#include "base/descriptor.h"

namespace isomesh::process {

// Sends the beginning of `bytes`, of which there is one at least, and with it a descriptor, which
// stays the caller's. Returns how many bytes went; -1 with errno for an error.
ssize_t send_with(int socket, std::string_view bytes, int passed);

// What has come: as recv() returns it, and the descriptor that came with it, if one did.
struct Received {
  ssize_t count = -1;
  Descriptor passed;
};
Received receive(int socket, std::span<char> target);

}  // namespace isomesh::process
