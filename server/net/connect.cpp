#include "server/net/connect.h"

#include <cerrno>
#include <memory>

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include "proto/error.h"

namespace isomesh::net {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kLookMs = 100;

std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> addresses_of(const std::string& host,
                                                                  std::uint16_t port) {
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    throw Error(ErrorCode::kUnreachable, "the host name cannot be resolved");
  }
  return {found, &::freeaddrinfo};
}

bool await_connection(const Descriptor& socket, Clock::time_point deadline,
                      const std::stop_token& stop) {
  pollfd waiting = {socket.number(), POLLOUT, 0};
  while (::poll(&waiting, 1, kLookMs) <= 0) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
    if (Clock::now() >= deadline) {
      throw Error(ErrorCode::kRequestTimeout, "the host does not respond");
    }
  }
  int error = 0;
  socklen_t size = sizeof error;
  return ::getsockopt(socket.number(), SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
}

}  // namespace

Descriptor connect_to(const std::string& host, std::uint16_t port, std::chrono::seconds timeout,
                      const std::stop_token& stop) {
  const auto deadline = Clock::now() + timeout;
  const auto addresses = addresses_of(host, port);
  for (const addrinfo* each = addresses.get(); each != nullptr; each = each->ai_next) {
    Descriptor socket(::socket(each->ai_family, each->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK,
                               each->ai_protocol));
    if (socket.number() < 0) continue;
    if (::connect(socket.number(), each->ai_addr, each->ai_addrlen) != 0 && errno != EINPROGRESS) {
      continue;
    }
    if (!await_connection(socket, deadline, stop)) continue;
    const int on = 1;
    ::setsockopt(socket.number(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    ::fcntl(socket.number(), F_SETFL, 0);
    return socket;
  }
  throw Error(ErrorCode::kUnreachable, "the connection to the host failed");
}

}  // namespace isomesh::net
