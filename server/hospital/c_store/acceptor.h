// Accepts connections and keeps each until its association request has arrived. One thread serves
// all, so a slow or silent peer occupies no place of an association.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <thread>
#include <unordered_map>

#include "base/descriptor.h"
#include "base/wakeup.h"
#include "server/hospital/c_store/tls_relay.h"
#include "server/net/fair_places.h"

namespace isomesh::c_store {

// A connection whose association request (PS3.8, A-ASSOCIATE-RQ) has arrived but is not read yet.
struct AssociationRequest {
  std::shared_ptr<TlsRelay> tls = {};  // null: the connection is not encrypted
  Descriptor peer = Descriptor();      // of TLS, its plain end; closed before the relay ends
  std::string party;                   // net::party_of its address
};

struct AcceptorLimits {
  std::size_t most_pending = 128;  // connections; addresses share them (FairPlaces)
  // From accepting to the complete request, with the handshake of TLS.
  std::chrono::milliseconds request_time{5'000};
  std::chrono::milliseconds wait_time{60'000};  // for a place, from the complete request on
};

// The acceptor's thread calls these.
struct AcceptorHooks {
  // Takes the request and returns true, or leaves it waiting and returns false. Must not block. Is
  // called for each waiting request, oldest first, and again soon.
  std::function<bool(AssociationRequest& request)> begin;
  // Is told why a connection will not become a request, if that is the peer's or our TLS.
  std::function<void(const std::string& party, net::TlsFault fault)> refused;
  // Starts TLS with an accepted connection; null: connections are not encrypted.
  std::function<std::unique_ptr<TlsRelay>(Descriptor peer)> encrypt = nullptr;
};

class AssociationAcceptor {
 public:
  // `listening` is a listening socket; it stays the caller's, and is made non-blocking. If there is
  // no place for another connection, closes the oldest one whose request is incomplete, or else the
  // new one. Starts at once.
  AssociationAcceptor(int listening, const AcceptorLimits& limits, AcceptorHooks hooks);
  ~AssociationAcceptor() { stop(); }  // as stop()
  AssociationAcceptor(const AssociationAcceptor&) = delete;
  AssociationAcceptor& operator=(const AssociationAcceptor&) = delete;

  // Call when places may be free for waiting requests. Thread safe.
  void wake() { wakeup_.ring(); }

  // Closes all connections without an association. Thread safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  struct Pending {
    std::uint64_t id = 0;  // identifier in epoll
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
  const AcceptorHooks hooks_;
  const Descriptor epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  net::FairPlaces places_;
  // Used by the acceptor's thread only, as are the next two members.
  PendingList pending_;  // oldest first
  std::unordered_map<std::uint64_t, PendingList::iterator> by_id_;
  std::uint64_t last_id_;
  std::jthread thread_;  // last: uses the other members
};

}  // namespace isomesh::c_store
