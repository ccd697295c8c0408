#include "tests/api/http.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/text.h"
#include "tests/support/process.h"

namespace isomesh::test {
namespace {

// The end of a child process interrupts connect(), which goes on by itself.
bool is_connected_later(int socket) {
  pollfd ready = {socket, POLLOUT, 0};
  while (::poll(&ready, 1, -1) < 0 && errno == EINTR) {
  }
  int error = 0;
  socklen_t size = sizeof error;
  return ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
}

template <class Address>
int connected(int family, const Address& address, const std::string& from) {
  const int socket = ::socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (!from.empty()) {
    sockaddr_in own = {};
    own.sin_family = AF_INET;
    ::inet_pton(AF_INET, from.c_str(), &own.sin_addr);
    if (::bind(socket, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) {
      ::close(socket);
      throw std::runtime_error(from + " is no address of this machine");
    }
  }
  const timeval longest = {std::chrono::seconds(kLongest).count(), 0};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &longest, sizeof longest);
  ::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof longest);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      !(errno == EINTR && is_connected_later(socket))) {
    ::close(socket);
    throw std::runtime_error("no connection to the daemon");
  }
  return socket;
}

int connected_to(const std::string& url, const std::string& from) {
  if (url.starts_with("unix:")) {
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    url.copy(address.sun_path, sizeof address.sun_path - 1, 5);
    return connected(AF_UNIX, address, "");
  }
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto port = static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)));
  address.sin_port = htons(port);
  return connected(AF_INET, address, from);
}

// The contents of a body's chunks, as far as they have come.
std::string joined(const std::string& chunks) {
  std::string bytes;
  for (std::size_t at = 0; at < chunks.size();) {
    const std::size_t size =
        std::stoul(chunks.substr(at, chunks.find("\r\n", at) - at), nullptr, 16);
    if (size == 0) break;
    at = chunks.find("\r\n", at) + 2;
    bytes += chunks.substr(at, size);
    at += size + 2;
  }
  return bytes;
}

Answer parse(const std::string& text) {
  Answer answer;
  const std::size_t end = text.find("\r\n\r\n");
  if (!text.starts_with("HTTP/1.1 ") || end == std::string::npos) return answer;
  answer.status = std::stoi(text.substr(9, 3));
  std::istringstream lines(text.substr(0, end));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    const std::size_t colon = line.find(": ");
    if (colon == std::string::npos) continue;
    std::string value = line.substr(colon + 2);
    if (value.ends_with('\r')) value.pop_back();
    answer.headers.emplace(lower(line.substr(0, colon)), value);
  }
  answer.body = text.substr(end + 4);
  if (answer.header("transfer-encoding") == "chunked") answer.body = joined(answer.body);
  return answer;
}

}  // namespace

std::string Answer::header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

Connection::Connection(const std::string& url, const std::string& from)
    : socket_(connected_to(url, from)) {}

Connection::~Connection() { ::close(socket_); }

bool Connection::send(std::string_view bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

void Connection::finish_sending() const { ::shutdown(socket_, SHUT_WR); }

// The end of a child process interrupts it.
ssize_t Connection::receive_into(std::string& block) const {
  while (true) {
    const ssize_t count = ::recv(socket_, block.data(), block.size(), 0);
    if (count >= 0 || errno != EINTR) return count;
  }
}

std::string Connection::receive_some() const {
  std::string block(4096, '\0');
  const ssize_t count = receive_into(block);
  if (count < 0) throw std::runtime_error("the daemon does not answer");
  block.resize(static_cast<std::size_t>(count));
  return block;
}

Answer Connection::receive() const {
  std::string text;
  std::string block(1 << 16, '\0');
  while (true) {
    const ssize_t count = receive_into(block);
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      throw std::runtime_error("the daemon does not answer");
    }
    if (count <= 0) return parse(text);
    text.append(block, 0, static_cast<std::size_t>(count));
  }
}

std::string request(const std::string& method, const std::string& target, const std::string& body,
                    const Headers& headers) {
  std::string text = method + ' ' + target + " HTTP/1.1\r\nHost: localhost\r\n";
  for (const auto& [name, value] : headers) text += name + ": " + value + "\r\n";
  if (method == "POST" || method == "PUT" || method == "PATCH" || !body.empty()) {
    text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  }
  return text + "\r\n" + body;
}

Answer answer_to(const std::string& url, std::string_view bytes, const std::string& from) {
  const Connection connection(url, from);
  connection.send(bytes);
  return connection.receive();
}

std::string chunked(std::string_view body, std::size_t chunk_bytes) {
  std::ostringstream text;
  for (; !body.empty(); body.remove_prefix(std::min(chunk_bytes, body.size()))) {
    const std::string_view chunk = body.substr(0, chunk_bytes);
    text << std::hex << chunk.size() << "\r\n" << chunk << "\r\n";
  }
  text << "0\r\n\r\n";
  return text.str();
}

}  // namespace isomesh::test
