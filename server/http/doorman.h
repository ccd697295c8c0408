// Takes connections in and keeps each until its request has come, so that nobody who is slow or
// silent holds a thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <thread>

#include "proto/error.h"
#include "server/http/byte_stream.h"
#include "server/http/request_head.h"
#include "server/http/wakeup.h"

struct epoll_event;

namespace isomesh::http {

// A connection whose request has come: its head and, when it is small, its whole body.
struct Visitor {
  std::unique_ptr<ByteStream> stream;
  std::string address;  // of the other side; empty for a Unix socket
  RequestHead head;
  BodyFraming framing;
  std::string body;  // what has come of it
};

struct DoormanLimits {
  std::size_t most_held = 1024;                    // the longest there goes when there is one more
  std::size_t most_bytes = std::size_t{32} << 20;  // of all that are held
  std::size_t small_body = 64 * 1024;              // such a body is waited for here
  std::chrono::milliseconds head_time{10'000};     // from the connection to the request
};

class Doorman {
 public:
  // Takes a visitor; must not block. Called by the doorman's thread.
  using Admit = std::function<void(Visitor visitor)>;
  // Takes a connection that sent no request: its answer is the error. Must not block.
  using TurnAway = std::function<void(std::unique_ptr<ByteStream> stream,
                                      const std::string& address, const Error& error)>;

  // `listening` is a listening socket, which stays the caller's and is made non-blocking. Begins
  // at once.
  Doorman(int listening, const DoormanLimits& limits, StreamOf stream_of, Admit admit,
          TurnAway turn_away);
  // As stop().
  ~Doorman();
  Doorman(const Doorman&) = delete;
  Doorman& operator=(const Doorman&) = delete;

  // Connections that are held at the moment. Thread safe.
  std::size_t held() const { return count_; }

  // No connection is accepted any more, those that are held are closed. Thread safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  struct Guest {
    Visitor visitor;
    std::string received;
    HeadScanner scanner;
    bool has_head = false;
    std::size_t wanted = 0;  // bytes of the body that are waited for
    Clock::time_point deadline;
    bool is_watched = false;
  };
  using Guests = std::list<Guest>;

  void work();
  void accept_some();
  void greet(int socket, std::string address);
  void serve(Guests::iterator guest);
  bool listen_to(Guest& guest);
  void watch(Guests::iterator guest, Transfer::State wanted);
  void close_overdue();
  void make_room();
  void let_in(Guests::iterator guest);
  void send_away(Guests::iterator guest, const Error& error);
  void close(Guests::iterator guest);

  const int listening_;
  const DoormanLimits limits_;
  const StreamOf stream_of_;
  const Admit admit_;
  const TurnAway turn_away_;
  const int epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  std::atomic<std::size_t> count_ = 0;
  Guests guests_;  // of the thread alone, as the next; oldest first
  std::size_t bytes_ = 0;
  std::jthread thread_;  // last: joined first
};

}  // namespace isomesh::http
