// A receiver of callbacks and other requests that records requests and sends configured responses.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace isomesh::test {

struct Received {
  std::string path;
  std::string body;
  std::map<std::string, std::string> headers;  // names in lower case
};

// Listens on a free port of loopback during its lifetime. Thread safe.
class Receiver {
 public:
  // Responds with the statuses in order, and then always with the last; 0 is no response until the
  // receiver is destroyed.
  explicit Receiver(std::vector<int> statuses = {204});
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  // http://127.0.0.1:PORT
  std::string url() const;
  // http://localhost:PORT
  std::string url_by_name() const;

  std::vector<Received> received() const;

  void answer_with(int status);

  bool gets(std::size_t count) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::test
