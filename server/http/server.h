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
  // Ends the orders and serving if that was not done.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Binds and returns the address for clients, such as http://127.0.0.1:8080 or unix:/run/iso.sock.
  // Throws Error kUnavailable if the address cannot be bound.
  std::string bind(const net::Address& address);

  // Starts serving until stop(). Call once, after bind. When it returns, the service is ready.
  // Throws std::system_error if a thread cannot be started.
  void start();

  // From now on /readyz answers 503, so that load balancers use other servers, and no job is
  // accepted. Thread safe.
  void begin_drain();

  // Stops serving and returns when all has ended: accepts no connections, ends all waiting, aborts
  // uploads and imports. Call after the orders have ended.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::http
