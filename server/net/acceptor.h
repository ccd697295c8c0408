// Accepts connections and keeps each until its request has come, all on one thread, so that a
// client that is slow or silent holds none.
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
#include "server/net/byte_stream.h"
#include "server/net/request_head.h"
#include "server/net/wakeup.h"

namespace isomesh::net {

// A connection whose request has come: its head and, when it is small, its whole body.
struct Connection {
  std::unique_ptr<ByteStream> stream;
  std::string address;  // of the other side; empty for a Unix socket
  RequestHead head;
  BodyFraming framing;
  std::string body;  // what has come of it
};

struct AcceptorLimits {
  std::size_t most_pending = 1024;                 // with one more the longest there is closed
  std::size_t most_bytes = std::size_t{32} << 20;  // received and not handed on, of all together
  std::size_t small_body = 64 * 1024;              // up to here a body is waited for, too
  std::chrono::milliseconds head_time{10'000};     // from the connection to the whole request
};

class Acceptor {
 public:
  // Takes a connection whose request has come. Must not block. Called by the acceptor's thread.
  using OnRequest = std::function<void(Connection connection)>;
  // Takes a connection whose request is malformed or too slow, to answer it with the error. Must
  // not block. Called by the acceptor's thread.
  using OnRefused = std::function<void(std::unique_ptr<ByteStream> stream,
                                       const std::string& address, const Error& error)>;

  // `listening` is a listening socket, which stays the caller's and is made non-blocking. Begins
  // at once.
  Acceptor(int listening, const AcceptorLimits& limits, StreamOf stream_of, OnRequest on_request,
           OnRefused on_refused);
  // As stop().
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  // Connections whose request has not come yet. Thread safe.
  std::size_t pending() const { return count_; }

  // No connection is accepted any more, and those whose request has not come are closed. Thread
  // safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  struct Pending {
    Connection connection;
    std::string received;
    HeadScanner scanner;
    bool has_head = false;
    std::size_t wanted = 0;  // bytes of the body that are waited for
    Clock::time_point deadline;
    bool is_watched = false;  // by epoll
  };
  using PendingList = std::list<Pending>;

  void work();
  void accept_some();
  void begin(int socket, std::string address);
  void read_some(PendingList::iterator pending);
  bool is_complete(Pending& pending);
  void watch(PendingList::iterator pending, Transfer::State wanted);
  void close_overdue();
  void close_oldest();
  void hand_on(PendingList::iterator pending);
  void refuse(PendingList::iterator pending, const Error& error);
  void close(PendingList::iterator pending);

  const int listening_;
  const AcceptorLimits limits_;
  const StreamOf stream_of_;
  const OnRequest on_request_;
  const OnRefused on_refused_;
  const int epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  std::atomic<std::size_t> count_ = 0;  // of pending_, for other threads
  // Only the acceptor's thread touches the next two.
  PendingList pending_;  // oldest first
  std::size_t bytes_ = 0;
  std::jthread thread_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::net
