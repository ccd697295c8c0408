#include "tests/unit/client/support.h"

#include <stdexcept>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/hex.h"
#include "base/sha256.h"
#include "proto/json.h"
#include "server/hospital/command/orders.h"

namespace isomesh::test {
namespace {

// A bound, listening socket on loopback and its port.
std::pair<int, int> listen_on_loopback() {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (::bind(listener, generic, size) != 0 || ::listen(listener, 8) != 0 ||
      ::getsockname(listener, generic, &size) != 0) {
    throw std::runtime_error("no socket on loopback");
  }
  return {listener, ntohs(address.sin_port)};
}

std::string url_of(int port) { return "http://127.0.0.1:" + std::to_string(port); }

}  // namespace

std::string FakeServer::start() {
  const int port = http.bind_to_any_port("127.0.0.1");
  thread_ = std::thread([this] { http.listen_after_bind(); });
  while (!http.is_running()) std::this_thread::yield();
  return url_of(port);
}

FakeServer::~FakeServer() {
  http.stop();
  if (thread_.joinable()) thread_.join();
}

SocketServer::SocketServer(std::function<void(int)> serve) : serve_(std::move(serve)) {
  std::tie(listener_, port_) = listen_on_loopback();
  thread_ = std::thread([this] {
    while (true) {
      const int socket = ::accept(listener_, nullptr, nullptr);
      if (socket < 0) return;
      ++connections_;
      serve_(socket);
      ::close(socket);
    }
  });
}

SocketServer::~SocketServer() {
  ::shutdown(listener_, SHUT_RDWR);
  thread_.join();
  ::close(listener_);
}

std::string SocketServer::url() const { return url_of(port_); }

std::string unused_url() {
  const auto [listener, port] = listen_on_loopback();
  ::close(listener);
  return url_of(port);
}

std::string read_head(int socket) {
  std::string head;
  char byte = 0;
  while (!head.ends_with("\r\n\r\n") && ::recv(socket, &byte, 1, 0) == 1) head += byte;
  return head;
}

std::size_t read_to_the_end(int socket) {
  std::string piece(64 * 1024, '\0');
  std::size_t received = 0;
  while (true) {
    const ssize_t count = ::recv(socket, piece.data(), piece.size(), 0);
    if (count <= 0) return received;
    received += static_cast<std::size_t>(count);
  }
}

void send_text(int socket, const std::string& text) {
  for (std::size_t sent = 0; sent < text.size();) {
    const ssize_t count = ::send(socket, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) return;
    sent += static_cast<std::size_t>(count);
  }
}

void answer(int socket, const std::string& head, const std::string& body) {
  send_text(socket, "HTTP/1.1 " + head + "\r\nContent-Length: " + std::to_string(body.size()) +
                        "\r\n\r\n" + body);
}

std::string pattern(std::size_t size) {
  std::string bytes(size, '\0');
  for (std::size_t n = 0; n < size; ++n) bytes[n] = static_cast<char>(n * 131 + n / 251);
  return bytes;
}

Volume some_volume() {
  Volume volume;
  volume.id = "abc";
  volume.format = "nifti";
  volume.dims = {2, 3, 4};
  return volume;
}

void answer_with(httplib::Response& response, const Error& error) {
  const Problem problem = to_problem(error, "/v1/here");
  response.status = problem.status;
  response.set_content(to_json(problem), "application/problem+json");
}

httplib::Server::Handler answering(const std::string& body, const std::string& type) {
  return [=](const httplib::Request&, httplib::Response& response) {
    response.set_content(body, type);
  };
}

Job finished_job(const std::string& id, const std::string& mesh_bytes, MeshFormat format) {
  Sha256 sha256;
  sha256.update(mesh_bytes);
  Job job;
  job.id = id;
  job.state = JobState::kSucceeded;
  job.stage = Stage::kDone;
  job.progress = 1;
  job.created = "2024-05-01T10:00:00Z";
  job.parameters.volume = "abc";
  job.parameters.iso = 60;
  job.mesh.emplace().files[format] = {
      .bytes = mesh_bytes.size(),
      .sha256 = to_hex(sha256.finish()),
      .href = "/v1/jobs/" + id + "/mesh." + std::string(to_string(format))};
  return job;
}

cli::Options options_from(const std::vector<std::string>& words) {
  std::vector<const char*> arguments = {"isomesh"};
  for (const std::string& word : words) arguments.push_back(word.c_str());
  static const cli::Added kAdded = cli::order_commands();
  return cli::parse_options(static_cast<int>(arguments.size()), arguments.data(), kAdded);
}

std::pair<int, std::string> end_of(const std::vector<std::string>& words) {
  try {
    options_from(words);
  } catch (const cli::EarlyExit& exit) {
    return {exit.status(), exit.what()};
  }
  return {-1, ""};
}

}  // namespace isomesh::test
