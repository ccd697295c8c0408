// Accepts connections and reads their requests, all on one thread, so that slow or silent clients
// hold no thread.
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

#include "base/wakeup.h"
#include "proto/error.h"
#include "server/net/byte_stream.h"
#include "server/net/fair_places.h"
#include "server/net/request_head.h"

namespace isomesh::net {

// A connection whose request has arrived: its head and, if it is small, its whole body.
struct Connection {
  std::unique_ptr<ByteStream> stream;  // holds the connection's place
  std::string address;                 // of the client; empty for a Unix socket
  RequestHead head;
  BodyFraming framing;
  std::string body;  // the bytes received so far
};

struct AcceptorLimits {
  std::size_t most_bytes = std::size_t{32} << 20;  // received bytes of all pending connections
  std::size_t small_body = 64 * 1024;              // largest body that is awaited too
  std::chrono::milliseconds head_time{10'000};     // from the connection to the complete request
};

class Acceptor {
 public:
  // Takes a connection with its request. Must not block. Called on the acceptor's thread.
  using OnRequest = std::function<void(Connection connection)>;
  // Takes a rejected connection, to send the error: its request is malformed or too slow, or there
  // is no place. Must not block. Called on the acceptor's thread.
  using OnRefused = std::function<void(std::unique_ptr<ByteStream> stream,
                                       const std::string& address, const Error& error)>;

  // `listening` is a listening socket; the caller owns it; it becomes non-blocking. A connection
  // holds one of `places` while its stream exists. If there is none, the oldest connection without
  // a complete request is closed, otherwise the new one is rejected. Starts immediately.
  Acceptor(int listening, const AcceptorLimits& limits, FairPlaces& places, StreamOf stream_of,
           OnRequest on_request, OnRefused on_refused);
  // Calls stop().
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  // The number of connections without a complete request. Thread safe.
  std::size_t pending() const { return count_; }

  // Stops accepting connections and closes those without a complete request. Thread safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  struct Pending {
    std::uint64_t id = 0;  // epoll's id
    Connection connection;
    std::string party;
    std::string received;
    HeadScanner scanner;
    bool has_head = false;
    std::size_t wanted = 0;  // awaited bytes of the body
    Clock::time_point deadline;
    bool is_watched = false;
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
  const Descriptor epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  std::atomic<std::size_t> count_ = 0;  // size of pending_, for other threads
  // The next four are used on the acceptor's thread only.
  PendingList pending_;  // oldest first
  std::unordered_map<std::uint64_t, PendingList::iterator> by_id_;
  std::uint64_t last_id_ = 0;
  std::size_t bytes_ = 0;
  std::jthread thread_;  // last, so that it ends before the members it uses
};

}  // namespace isomesh::net
