#include "server/net/listener.h"

#include <cerrno>
#include <memory>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "proto/error.h"

namespace isomesh::net {
namespace {

void turn(int socket, int level, int option, bool on) {
  const int value = on ? 1 : 0;
  ::setsockopt(socket, level, option, &value, sizeof value);
}

// No descriptor if the address cannot be bound. The queue has the kernel's maximum length: a client
// that does not fit retries after a second.
Descriptor bound(Descriptor socket, const sockaddr* address, socklen_t size) {
  const bool listens = socket.number() >= 0 && ::bind(socket.number(), address, size) == 0 &&
                       ::listen(socket.number(), SOMAXCONN) == 0;
  return listens ? std::move(socket) : Descriptor();
}

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.string().copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

// A killed program leaves its socket, at which connections are refused.
bool is_left_over(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_socket(path, error)) return false;
  const sockaddr_un address = address_of(path);
  const Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  return socket.number() >= 0 &&
         ::connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) !=
             0 &&
         errno == ECONNREFUSED;
}

// Tells the file of one program's socket from that of a later one at the same path.
std::optional<FileIdentity> identity_of(const std::filesystem::path& path) {
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino};
}

Descriptor listening_at(const std::filesystem::path& path) {
  std::error_code error;
  if (is_left_over(path)) std::filesystem::remove(path, error);
  const sockaddr_un address = address_of(path);
  Descriptor socket =
      bound(Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)),
            reinterpret_cast<const sockaddr*>(&address), static_cast<socklen_t>(sizeof address));
  // Lets a reverse proxy of the same group connect.
  if (socket.number() >= 0) ::chmod(path.c_str(), 0660);
  return socket;
}

Descriptor listening_at(const std::string& host, int port) {
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    return Descriptor();
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> addresses(found, &::freeaddrinfo);
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    Descriptor socket(
        ::socket(each->ai_family, each->ai_socktype | SOCK_CLOEXEC, each->ai_protocol));
    // Not SO_REUSEPORT: a second daemon could take half of the connections.
    turn(socket.number(), SOL_SOCKET, SO_REUSEADDR, true);
    turn(socket.number(), IPPROTO_TCP, TCP_NODELAY, true);  // accepted sockets inherit it
    if (each->ai_family == AF_INET6) turn(socket.number(), IPPROTO_IPV6, IPV6_V6ONLY, false);
    socket = bound(std::move(socket), each->ai_addr, each->ai_addrlen);
    if (socket.number() >= 0) return socket;
  }
  return Descriptor();
}

int port_of(int socket) {
  sockaddr_storage address = {};
  socklen_t size = sizeof address;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                   : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

}  // namespace

Listener::Listener(Address address)
    : address_(std::move(address)),
      socket_(address_.is_unix() ? listening_at(address_.unix_path)
                                 : listening_at(address_.host, address_.port)) {
  if (socket_.number() < 0) {
    throw Error(ErrorCode::kUnavailable, "cannot listen on this address: is it already in use?");
  }
  if (address_.is_unix()) {
    file_ = identity_of(address_.unix_path);
  } else {
    address_.port = port_of(socket_.number());
  }
}

Listener::~Listener() {
  std::error_code ignored;  // the next start removes leftovers
  if (file_ && file_ == identity_of(address_.unix_path)) {
    std::filesystem::remove(address_.unix_path, ignored);
  }
}

std::string Listener::authority() const {
  if (address_.is_unix()) return "unix:" + address_.unix_path.string();
  const bool is_v6 = address_.host.find(':') != std::string::npos;
  return (is_v6 ? '[' + address_.host + ']' : address_.host) + ':' + std::to_string(address_.port);
}

}  // namespace isomesh::net
