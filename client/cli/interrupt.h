// Ctrl-C as a stop request instead of an immediate end.
#pragma once

#include <atomic>
#include <stop_token>
#include <thread>

namespace isomesh::cli {

// Construct it first in main, while only one thread runs: it blocks SIGINT, SIGTERM and SIGHUP,
// unless that is ignored, for all threads and waits for them on a thread of its own. The first
// signal requests a stop; a second one, except SIGHUP, ends the process immediately, by that
// signal.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  std::stop_token token() const { return source_.get_token(); }

  // Ends the process by the received signal, with its default action; returns if there was none. A
  // shell ends its loop only if the command has died by SIGINT.
  void end_by_signal() const;

 private:
  std::stop_source source_;
  std::atomic<int> signal_ = 0;
  std::jthread waiter_;
};

}  // namespace isomesh::cli
