#include "server/hospital/c_store/acceptor.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <span>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "proto/error.h"
#include "server/net/address.h"

namespace isomesh::c_store {
namespace {

constexpr int kMostEvents = 128;
constexpr int kTickMilliseconds = 100;
constexpr int kMostAcceptedAtOnce = 64;
// Identifiers in epoll of the two descriptors that are not peers' connections; those have greater
// ones.
constexpr std::uint64_t kListening = 0;
constexpr std::uint64_t kWakeup = 1;

// Every PDU starts with its type, a reserved byte and the length of the rest (PS3.8, 9.3.1).
constexpr std::size_t kHeadBytes = 6;
constexpr unsigned char kAssociateRequest = 1;
// More than 128 presentation contexts with all transfer syntaxes need.
constexpr std::uint32_t kLongestRequest = 1U << 20;
// A longer request is begun when this much has arrived, because a socket does not buffer all of it.
// The association reads the rest.
constexpr std::uint32_t kEnough = 32 * 1024;

constexpr unsigned char kTlsHandshake = 22;  // the first byte of a TLS connection

enum class Arrival {
  kPartly,
  kWhole,
  kTls,   // the peer starts TLS, but is not expected to
  kNone,  // will not become a request
};

// Peeks without consuming received bytes.
Arrival arrival_of(int peer) {
  std::array<unsigned char, kHeadBytes> head = {};
  const ssize_t count = ::recv(peer, head.data(), head.size(), MSG_PEEK | MSG_DONTWAIT);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return Arrival::kPartly;
  if (count > 0 && head[0] == kTlsHandshake) return Arrival::kTls;
  if (count <= 0 || head[0] != kAssociateRequest) return Arrival::kNone;
  if (static_cast<std::size_t>(count) < head.size()) return Arrival::kPartly;
  std::uint32_t length = 0;
  for (const unsigned char byte : std::span(head).subspan(2)) length = length << 8 | byte;
  if (length > kLongestRequest) return Arrival::kNone;
  int available = 0;
  if (::ioctl(peer, FIONREAD, &available) != 0) return Arrival::kNone;
  const std::uint32_t wanted = std::min<std::uint32_t>(kHeadBytes + length, kEnough);
  return static_cast<std::uint32_t>(available) >= wanted ? Arrival::kWhole : Arrival::kPartly;
}

bool has_hung_up(int peer) {
  pollfd waiting = {peer, POLLRDHUP, 0};
  return ::poll(&waiting, 1, 0) > 0;
}

}  // namespace

AssociationAcceptor::AssociationAcceptor(int listening, const AcceptorLimits& limits,
                                         AcceptorHooks hooks)
    : listening_(listening),
      limits_(limits),
      hooks_(std::move(hooks)),
      epoll_(new_epoll()),
      places_(limits.most_pending, "connections"),
      last_id_(kWakeup) {
  ::fcntl(listening_, F_SETFL, ::fcntl(listening_, F_GETFL) | O_NONBLOCK);
  watch_or_throw(epoll_.number(), listening_, EPOLLIN, kListening);
  watch_or_throw(epoll_.number(), wakeup_.descriptor(), EPOLLIN, kWakeup);
  thread_ = std::jthread([this] { work(); });
}

void AssociationAcceptor::stop() {
  stopping_ = true;
  wakeup_.ring();
  if (thread_.joinable()) thread_.join();
}

void AssociationAcceptor::work() {
  std::array<epoll_event, kMostEvents> events = {};
  while (!stopping_) {
    const int count = ::epoll_wait(epoll_.number(), events.data(), kMostEvents, kTickMilliseconds);
    wakeup_.clear();
    bool has_new = false;
    for (int i = 0; i < count; ++i) {
      const std::uint64_t who = events.at(static_cast<std::size_t>(i)).data.u64;
      has_new = has_new || who == kListening;
      const auto pending = by_id_.find(who);
      if (pending != by_id_.end()) look_at(pending->second);
    }
    if (has_new) accept_some();
    close_overdue();
    begin_some();
  }
  by_id_.clear();
  pending_.clear();
}

void AssociationAcceptor::accept_some() {
  for (int n = 0; n < kMostAcceptedAtOnce && !stopping_; ++n) {
    sockaddr_storage from = {};
    socklen_t size = sizeof from;
    // Blocking, as the association expects.
    Descriptor peer(::accept4(listening_, reinterpret_cast<sockaddr*>(&from), &size, SOCK_CLOEXEC));
    if (peer.number() >= 0) {
      add(std::move(peer), net::party_of(net::address_of(from)));
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Closing the oldest pending connection frees a descriptor. If there is none, the descriptors
      // are used elsewhere.
      if (!make_room("")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
      return;
    } else if (errno != ECONNABORTED && errno != EINTR) {
      return;
    }
  }
}

void AssociationAcceptor::add(Descriptor peer, std::string party) {
  std::shared_ptr<TlsRelay> tls;
  while (true) {
    try {
      Pending pending = {.id = last_id_ + 1,
                         .request = {},
                         .place = places_.take(party),
                         .is_whole = false,
                         .deadline = Clock::now() + limits_.request_time};
      if (hooks_.encrypt && !tls) {
        tls = hooks_.encrypt(std::move(peer));
        peer = tls->take_plain_end();
      }
      // Edge-triggered, because received bytes stay in the socket.
      watch_or_throw(epoll_.number(), peer.number(), EPOLLIN | EPOLLRDHUP | EPOLLET, pending.id);
      pending.request = {.tls = std::move(tls), .peer = std::move(peer), .party = std::move(party)};
      pending_.push_back(std::move(pending));
      by_id_.emplace(++last_id_, std::prev(pending_.end()));
      return;
    } catch (const Error& error) {
      if (peer.number() < 0) return;  // TLS could not be started, and the connection is closed
      const bool has_share = error.code() == ErrorCode::kTooManyRequests;
      if (!make_room(has_share ? party : "")) return;
    }
  }
}

// Closes the oldest pending connection of that party, or of all for "". Returns false if all their
// requests have arrived.
bool AssociationAcceptor::make_room(const std::string& party) {
  const auto oldest = std::ranges::find_if(pending_, [&](const Pending& pending) {
    return !pending.is_whole && (party.empty() || pending.request.party == party);
  });
  if (oldest == pending_.end()) return false;
  close(oldest);
  return true;
}

void AssociationAcceptor::look_at(PendingList::iterator pending) {
  const int peer = pending->request.peer.number();
  const Arrival arrival = arrival_of(peer);
  if (arrival == Arrival::kTls) {
    hooks_.refused(pending->request.party, net::TlsFault::kNotTls);
    close(pending);
  } else if (arrival == Arrival::kNone || has_hung_up(peer)) {
    const auto& tls = pending->request.tls;
    if (tls && tls->fault() != net::TlsFault::kNone) {
      hooks_.refused(pending->request.party, tls->fault());
    }
    close(pending);
  } else if (arrival == Arrival::kWhole) {
    ::epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, peer, nullptr);
    pending->is_whole = true;
    pending->deadline = Clock::now() + limits_.wait_time;
  }
}

void AssociationAcceptor::begin_some() {
  for (auto pending = pending_.begin(); pending != pending_.end();) {
    const bool is_over = pending->is_whole && (has_hung_up(pending->request.peer.number()) ||
                                               hooks_.begin(pending->request));
    pending = is_over ? close(pending) : std::next(pending);
  }
}

void AssociationAcceptor::close_overdue() {
  const auto now = Clock::now();
  for (auto pending = pending_.begin(); pending != pending_.end();) {
    pending = now >= pending->deadline ? close(pending) : std::next(pending);
  }
}

AssociationAcceptor::PendingList::iterator AssociationAcceptor::close(
    PendingList::iterator pending) {
  by_id_.erase(pending->id);
  return pending_.erase(pending);
}

}  // namespace isomesh::c_store
