#pragma once

#include <optional>
#include <string>
#include <utility>

#include <sys/types.h>

#include "base/descriptor.h"
#include "server/net/address.h"

namespace isomesh::net {

using FileIdentity = std::pair<dev_t, ino_t>;

// Constant after construction.
class Listener {
 public:
  // Binds and listens. Connections wait in the kernel's queue for an Acceptor. Throws Error
  // kUnavailable if the address cannot be bound, or if a program listens at the Unix socket.
  explicit Listener(Address address);
  // Removes the file of a Unix socket, if it is still the same.
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int descriptor() const { return socket_.number(); }

  // The listening address, with the port assigned for port 0: 127.0.0.1:8080, [::1]:8080 or
  // unix:/run/iso.sock.
  std::string authority() const;

 private:
  Address address_;
  Descriptor socket_;
  std::optional<FileIdentity> file_;  // of a Unix socket
};

}  // namespace isomesh::net
