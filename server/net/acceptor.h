// Accepts connections and keeps each until its request has come, all on one thread, so that a
// client that is slow or silent holds none.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>

#include "proto/error.h"
#include "server/net/byte_stream.h"
#include "server/net/fair_places.h"
#include "server/net/request_head.h"
#include "server/net/wakeup.h"

namespace isomesh::net {

// A connection whose request has come: its head and, when it is small, its whole body.
struct Connection {
  std::unique_ptr<ByteStream> stream;  // holds the connection's place
  std::string address;                 // of the other side; empty for a Unix socket
  RequestHead head;
  BodyFraming framing;
  std::string body;  // what has come of it
};

struct AcceptorLimits {
  std::size_t most_bytes = std::size_t{32} << 20;  // received and not handed on, of all together
  std::size_t small_body = 64 * 1024;              // up to here a body is waited for, too
  std::chrono::milliseconds head_time{10'000};     // from the connection to the whole request
};

class Acceptor {
 public:
  // Takes a connection whose request has come. Must not block. Called by the acceptor's thread.
  using OnRequest = std::function<void(Connection connection)>;
  // Takes a connection whose request is malformed or too slow, or that there is no place for, to
  // answer it with the error. Must not block. Called by the acceptor's thread.
  using OnRefused = std::function<void(std::unique_ptr<ByteStream> stream,
                                       const std::string& address, const Error& error)>;

  // `listening` is a listening socket, which stays the caller's and is made non-blocking. A
  // connection takes one of `places` for as long as its stream lives; where there is none, the
  // oldest makes room whose request has not come, and else the new one is refused. Begins at once.
  Acceptor(int listening, const AcceptorLimits& limits, FairPlaces& places, StreamOf stream_of,
           OnRequest on_request, OnRefused on_refused);
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
    std::uint64_t id = 0;  // to epoll
    Connection connection;
    std::string party;
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
  std::optional<FairPlaces::Place> place_for(const std::string& party);
  bool close_oldest_of(const std::string& party);
  void read_some(PendingList::iterator pending);
  bool is_complete(Pending& pending);
  void watch(PendingList::iterator pending, Transfer::State wanted);
  void close_overdue();
  void close_greediest();
  void hand_on(PendingList::iterator pending);
  void refuse(PendingList::iterator pending, const Error& error);
  void close(PendingList::iterator pending);

  const int listening_;
  const AcceptorLimits limits_;
  FairPlaces& places_;
  const StreamOf stream_of_;
  const OnRequest on_request_;
  const OnRefused on_refused_;
  const int epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  std::atomic<std::size_t> count_ = 0;  // of pending_, for other threads
  // Only the acceptor's thread touches the next four.
  PendingList pending_;  // oldest first
  std::unordered_map<std::uint64_t, PendingList::iterator> by_id_;
  std::uint64_t last_id_ = 0;
  std::size_t bytes_ = 0;
  std::jthread thread_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::net
