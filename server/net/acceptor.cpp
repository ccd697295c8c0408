#include "server/net/acceptor.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <map>
#include <utility>

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "server/net/address.h"

namespace isomesh::net {
namespace {

constexpr int kMostEvents = 128;
constexpr int kTickMilliseconds = 250;  // interval between checks of deadlines
constexpr int kMostAcceptedAtOnce = 64;
constexpr std::size_t kBlock = 16 * 1024;
// epoll's ids of the two descriptors that are no connections; those have higher ids.
constexpr std::uint64_t kListening = 0;
constexpr std::uint64_t kWakeup = 1;

// A stream with its place among the connections, which is released after the descriptor.
class PlacedStream : public ByteStream {
 public:
  PlacedStream(FairPlaces::Place place, std::unique_ptr<ByteStream> stream)
      : place_(std::move(place)), stream_(std::move(stream)) {}

  int descriptor() const override { return stream_->descriptor(); }
  Transfer read(std::span<char> target) override { return stream_->read(target); }
  Transfer write(std::string_view bytes) override { return stream_->write(bytes); }
  void finish_writing() override { stream_->finish_writing(); }

 private:
  const FairPlaces::Place place_;
  const std::unique_ptr<ByteStream> stream_;
};

}  // namespace

Acceptor::Acceptor(int listening, const AcceptorLimits& limits, FairPlaces& places,
                   StreamOf stream_of, OnRequest on_request, OnRefused on_refused)
    : listening_(listening),
      limits_(limits),
      places_(places),
      stream_of_(std::move(stream_of)),
      on_request_(std::move(on_request)),
      on_refused_(std::move(on_refused)),
      epoll_(new_epoll()) {
  ::fcntl(listening_, F_SETFL, ::fcntl(listening_, F_GETFL) | O_NONBLOCK);
  watch_or_throw(epoll_.number(), listening_, EPOLLIN, kListening);
  watch_or_throw(epoll_.number(), wakeup_.descriptor(), EPOLLIN, kWakeup);
  last_id_ = kWakeup;
  thread_ = std::jthread([this] { work(); });
}

Acceptor::~Acceptor() { stop(); }

void Acceptor::stop() {
  stopping_ = true;
  wakeup_.ring();
  if (thread_.joinable()) thread_.join();
}

void Acceptor::work() {
  std::array<epoll_event, kMostEvents> events = {};
  Clock::time_point last_tick = Clock::now();
  while (!stopping_) {
    const int count = ::epoll_wait(epoll_.number(), events.data(), kMostEvents, kTickMilliseconds);
    bool has_new = false;
    for (int i = 0; i < count; ++i) {
      const std::uint64_t who = events.at(static_cast<std::size_t>(i)).data.u64;
      has_new = has_new || who == kListening;
      const auto pending = by_id_.find(who);  // may have been closed in this batch
      if (pending != by_id_.end()) read_some(pending->second);
    }
    if (has_new) accept_some();
    if (Clock::now() - last_tick >= std::chrono::milliseconds(kTickMilliseconds)) {
      last_tick = Clock::now();
      close_overdue();
    }
  }
  by_id_.clear();
  pending_.clear();
  count_ = 0;
}

void Acceptor::accept_some() {
  for (int n = 0; n < kMostAcceptedAtOnce && !stopping_; ++n) {
    sockaddr_storage peer = {};
    socklen_t size = sizeof peer;
    const int socket = ::accept4(listening_, reinterpret_cast<sockaddr*>(&peer), &size,
                                 SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (socket >= 0) {
      begin(socket, address_of(peer));
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Close the oldest pending connection to free its descriptor. If there is none, responses
      // hold the descriptors, so wait.
      if (pending_.empty()) {
        log_warning("new connections wait: no file descriptors are left");
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return;
      }
      close(pending_.begin());
    } else if (errno != ECONNABORTED && errno != EINTR) {
      return;
    }
  }
}

void Acceptor::begin(int socket, std::string address) {
  std::string party = party_of(address);
  auto place = place_for(party);
  try {
    std::unique_ptr<ByteStream> stream = stream_of_(socket);
    if (!place) {
      return on_refused_(std::move(stream), address,
                         {ErrorCode::kUnavailable, "too many connections are open"});
    }
    Pending& pending = pending_.emplace_back();
    pending.connection.stream =
        std::make_unique<PlacedStream>(std::move(*place), std::move(stream));
    pending.connection.address = std::move(address);
    pending.party = std::move(party);
    pending.deadline = Clock::now() + limits_.head_time;
    pending.id = ++last_id_;
  } catch (const std::exception& error) {
    log_warning("a connection could not be accepted: {}", error.what());
    return;
  }
  const auto pending = std::prev(pending_.end());
  by_id_.emplace(pending->id, pending);
  ++count_;
  read_some(pending);
}

// Connections without a complete request make room: those of the same party if it has its share.
// Returns empty if others hold all places.
std::optional<FairPlaces::Place> Acceptor::place_for(const std::string& party) {
  while (true) {
    try {
      return places_.take(party);
    } catch (const Error& error) {
      const bool has_share = error.code() == ErrorCode::kTooManyRequests;
      if (!close_oldest_of(has_share ? party : "")) return std::nullopt;
    }
  }
}

// Closes the oldest pending connection of the party, or of all for "". Returns false if there is
// none.
bool Acceptor::close_oldest_of(const std::string& party) {
  const auto oldest = std::ranges::find_if(
      pending_, [&](const Pending& pending) { return party.empty() || pending.party == party; });
  if (oldest == pending_.end()) return false;
  close(oldest);
  return true;
}

void Acceptor::read_some(PendingList::iterator pending) {
  try {
    while (true) {
      const std::size_t before = pending->received.size();
      pending->received.resize(before + kBlock);
      const Transfer transfer =
          pending->connection.stream->read(std::span(pending->received).subspan(before));
      pending->received.resize(before + transfer.bytes);
      bytes_ += transfer.bytes;
      if (transfer.state == Transfer::State::kClosed) {
        const bool is_silent = pending->received.empty() && !pending->has_head;
        return is_silent ? close(pending)
                         : refuse(pending, {ErrorCode::kInvalidParameter,
                                            "the request ended before it was complete"});
      }
      if (transfer.state != Transfer::State::kDone) return watch(pending, transfer.state);
      if (is_complete(*pending)) return hand_on(pending);
      if (bytes_ > limits_.most_bytes) {
        watch(pending, Transfer::State::kWantsRead);  // the rest is read later
        return close_greediest();
      }
    }
  } catch (const Error& error) {
    refuse(pending, error);
  }
}

// True if the head, and the body if it is awaited, have arrived. Throws if the request is
// malformed.
bool Acceptor::is_complete(Pending& pending) {
  if (!pending.has_head) {
    const auto size = pending.scanner.scan(pending.received);
    if (!size) return false;
    Connection& connection = pending.connection;
    connection.head = parse_head(std::string_view(pending.received).substr(0, *size));
    connection.framing = framing_of(connection.head);
    bytes_ -= *size;
    pending.received.erase(0, *size);
    pending.has_head = true;
    // A client with the header Expect waits for the handler's decision.
    const std::uint64_t length = connection.framing.length.value_or(0);
    const bool asks_first = find_header(connection.head.headers, "Expect") != nullptr;
    pending.wanted = length <= limits_.small_body && !asks_first ? length : 0;
  }
  return pending.received.size() >= pending.wanted;
}

void Acceptor::watch(PendingList::iterator pending, Transfer::State wanted) {
  const auto events = wanted == Transfer::State::kWantsWrite ? EPOLLOUT : EPOLLIN;
  const int descriptor = pending->connection.stream->descriptor();
  if (!isomesh::watch(epoll_.number(), descriptor, events, pending->id,
                      std::exchange(pending->is_watched, true))) {
    close(pending);
  }
}

// All have the same time limit, so the oldest expires first.
void Acceptor::close_overdue() {
  const auto now = Clock::now();
  while (!pending_.empty() && now >= pending_.front().deadline) {
    if (pending_.front().received.empty() && !pending_.front().has_head) {
      close(pending_.begin());
    } else {
      refuse(pending_.begin(), {ErrorCode::kRequestTimeout, "the request did not arrive in time"});
    }
  }
}

// The party with the most buffered bytes loses its oldest connection.
void Acceptor::close_greediest() {
  while (bytes_ > limits_.most_bytes) {
    std::map<std::string_view, std::size_t> held;
    for (const Pending& pending : pending_) held[pending.party] += pending.received.size();
    const auto most = std::ranges::max_element(held, {}, &decltype(held)::value_type::second);
    close(std::ranges::find_if(pending_, [&](const Pending& pending) {
      return pending.party == most->first && !pending.received.empty();
    }));
  }
}

void Acceptor::hand_on(PendingList::iterator pending) {
  Connection connection = std::move(pending->connection);
  connection.body = std::move(pending->received);
  if (pending->is_watched) {
    ::epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, connection.stream->descriptor(), nullptr);
  }
  bytes_ -= connection.body.size();
  by_id_.erase(pending->id);
  pending_.erase(pending);
  --count_;
  on_request_(std::move(connection));
}

void Acceptor::refuse(PendingList::iterator pending, const Error& error) {
  const std::unique_ptr<ByteStream>& stream = pending->connection.stream;
  if (pending->is_watched)
    ::epoll_ctl(epoll_.number(), EPOLL_CTL_DEL, stream->descriptor(), nullptr);
  on_refused_(std::move(pending->connection.stream), pending->connection.address, error);
  close(pending);
}

// Closing a stream removes it from epoll.
void Acceptor::close(PendingList::iterator pending) {
  bytes_ -= pending->received.size();
  by_id_.erase(pending->id);
  pending_.erase(pending);
  --count_;
}

}  // namespace isomesh::net
