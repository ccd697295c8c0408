// A receiver of callbacks: keeps what comes and answers as it is told.
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

// Listens on a free port of loopback until it goes. Thread safe.
class Receiver {
 public:
  // Answers with those statuses, one after the other, and with the last for ever; 0 is no answer
  // until the receiver goes.
  explicit Receiver(std::vector<int> statuses = {204});
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  // http://127.0.0.1:PORT
  std::string url() const;
  // http://localhost:PORT
  std::string url_by_name() const;

  std::vector<Received> received() const;

  // What it answers from now on.
  void answer_with(int status);

  // Whether so many requests come in time.
  bool gets(std::size_t count) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh::test
