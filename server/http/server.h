// The HTTP side of the daemon.
#pragma once

#include <memory>
#include <string>

#include "server/http/app/services.h"
#include "server/net/address.h"

namespace isomesh::http {

// Thread safe where said.
class Server {
 public:
  Server(const Services& services, const ServerOptions& options);
  // As stop().
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Binds; returns what clients connect to, such as http://127.0.0.1:8080 or unix:/run/iso.sock.
  // Throws Error kUnavailable when the address cannot be bound.
  std::string bind(const net::Address& address);

  // Serves until stop(); to be called once, after bind. Whatever serving needs is there when it
  // returns. Throws std::system_error if a thread cannot be started.
  void start();

  // /readyz answers 503 from now on, so that a load balancer looks elsewhere, and no job is
  // accepted. Thread safe.
  void begin_drain();

  // Returns when nothing is served any more: no connection is accepted, nobody waits for a job,
  // uploads and imports are cut off. To be called after the orders have ended.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::http
