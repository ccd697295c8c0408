// Ctrl-C as a stop request instead of a sudden end.
#pragma once

#include <stop_token>
#include <thread>

namespace isomesh::cli {

// To be made first in main, before any other thread, while one thread runs: blocks SIGINT and
// SIGTERM for all and waits for them on a thread of its own. The first asks to stop; the second
// ends the process at once with status 1.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread waiter_;
};

}  // namespace isomesh::cli
