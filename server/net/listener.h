// A socket that connections arrive at.
#pragma once

#include <string>

#include "base/descriptor.h"
#include "server/net/address.h"

namespace isomesh::net {

// Constant once it is made.
class Listener {
 public:
  // Binds and listens. Connections queue up in the kernel until an Acceptor takes them. Throws
  // Error kUnavailable when the address cannot be bound.
  explicit Listener(Address address);
  // Removes the file of a Unix socket.
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int descriptor() const { return socket_.number(); }

  // Where it listens, with the port that was found for port 0: 127.0.0.1:8080, [::1]:8080 or
  // unix:/run/iso.sock.
  std::string authority() const;

 private:
  Address address_;
  Descriptor socket_;
};

}  // namespace isomesh::net
