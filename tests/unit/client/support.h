// Servers of this process for the client to talk to.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <httplib.h>

#include "client/cli/options.h"
#include "client/isomesh/client.h"
#include "proto/types.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::test {

// An HTTP server on a free port of loopback. Routes are added through `http` before `start`.
class FakeServer {
 public:
  FakeServer() = default;
  ~FakeServer();
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;

  std::string start();  // returns its URL

  httplib::Server http;

 private:
  std::thread thread_;
};

// Accepts connections on a free port of loopback, one after the other, and hands each to `serve`,
// after which it is closed.
class SocketServer {
 public:
  explicit SocketServer(std::function<void(int socket)> serve);
  ~SocketServer();
  SocketServer(const SocketServer&) = delete;
  SocketServer& operator=(const SocketServer&) = delete;

  std::string url() const;
  int connections() const { return connections_; }

 private:
  int listener_;
  int port_ = 0;
  std::atomic<int> connections_ = 0;
  std::function<void(int)> serve_;
  std::thread thread_;
};

// A port of loopback that nothing listens on.
std::string unused_url();

// Reads from the socket until the head of a request has come, and returns it.
std::string read_head(int socket);
// Reads until the client closes the connection, and returns how many bytes came.
std::size_t read_to_the_end(int socket);
// Sends all of it; a client that went away is no error.
void send_text(int socket, const std::string& text);
// Sends a response; `head` is its status and headers: "201 Created\r\nLocation: /there".
void answer(int socket, const std::string& head, const std::string& body = {});

// Bytes that are not the same anywhere near.
std::string pattern(std::size_t size);

// A volume as an upload is answered with.
Volume some_volume();

// Answers with the problem that the error is.
void answer_with(httplib::Response& response, const Error& error);

// Always the same answer.
httplib::Server::Handler answering(const std::string& body,
                                   const std::string& type = "application/json");

// A job that has succeeded with one file of these bytes.
Job finished_job(const std::string& id, const std::string& mesh_bytes,
                 MeshFormat format = MeshFormat::kDrc);

// The options of the command with these arguments.
cli::Options options_from(const std::vector<std::string>& words);

// The status and the text that the arguments end with; -1 if they are accepted.
std::pair<int, std::string> end_of(const std::vector<std::string>& words);

}  // namespace isomesh::test
