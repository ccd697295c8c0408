// Accepts the connections of peers and keeps each until its association request has come, all on
// one thread, so that a peer that is slow or silent holds no place of an association.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <string>
#include <thread>
#include <unordered_map>

#include "base/descriptor.h"
#include "server/net/fair_places.h"
#include "server/net/wakeup.h"

namespace isomesh::dimse {

// A connection whose association request (PS3.8, A-ASSOCIATE-RQ) has come and is not read yet.
struct AssociationRequest {
  Descriptor peer = Descriptor();
  std::string party;  // net::party_of its address
};

struct AcceptorLimits {
  std::size_t most_pending = 128;                 // connections, shared by address (FairPlaces)
  std::chrono::milliseconds request_time{5'000};  // from the connection to the whole request
  std::chrono::milliseconds wait_time{60'000};    // from then on, for a place
};

class AssociationAcceptor {
 public:
  // Takes the request and returns true, or leaves it to wait. Must not block. Called by the
  // acceptor's thread, for each that waits: the oldest first, and all of them again soon.
  using Begin = std::function<bool(AssociationRequest& request)>;

  // `listening` is a listening socket, which stays the caller's and is made non-blocking. Where
  // there is no room for a further connection, the oldest makes room whose request has not come,
  // and else the new one is closed. Begins at once.
  AssociationAcceptor(int listening, const AcceptorLimits& limits, Begin begin);
  ~AssociationAcceptor() { stop(); }  // as stop()
  AssociationAcceptor(const AssociationAcceptor&) = delete;
  AssociationAcceptor& operator=(const AssociationAcceptor&) = delete;

  // There may be a place for requests that wait. Thread safe.
  void wake() { wakeup_.ring(); }

  // Closes all connections that no association was begun for. Thread safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  struct Pending {
    std::uint64_t id = 0;  // to epoll
    AssociationRequest request;
    net::FairPlaces::Place place;
    bool is_whole = false;
    Clock::time_point deadline;
  };
  using PendingList = std::list<Pending>;

  void work();
  void accept_some();
  void add(Descriptor peer, std::string party);
  bool make_room(const std::string& party);
  void look_at(PendingList::iterator pending);
  void begin_some();
  void close_overdue();
  PendingList::iterator close(PendingList::iterator pending);

  const int listening_;
  const AcceptorLimits limits_;
  const Begin begin_;
  const Descriptor epoll_;
  net::Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  net::FairPlaces places_;
  // Only the acceptor's thread touches the next three.
  PendingList pending_;  // oldest first
  std::unordered_map<std::uint64_t, PendingList::iterator> by_id_;
  std::uint64_t last_id_;
  std::jthread thread_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::dimse
