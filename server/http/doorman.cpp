#include "server/http/doorman.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include <arpa/inet.h>
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace isomesh::http {
namespace {

constexpr int kMostEvents = 128;
constexpr int kTickMilliseconds = 250;  // how often deadlines are looked at
constexpr int kMostAcceptedAtOnce = 64;
constexpr std::size_t kBlock = 16 * 1024;

std::string address_of(const sockaddr_storage& peer) {
  std::array<char, INET6_ADDRSTRLEN> text = {};
  const void* address = nullptr;
  if (peer.ss_family == AF_INET) {
    address = &reinterpret_cast<const sockaddr_in&>(peer).sin_addr;
  } else if (peer.ss_family == AF_INET6) {
    address = &reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr;
  }
  if (address == nullptr ||
      ::inet_ntop(peer.ss_family, address, text.data(), text.size()) == nullptr) {
    return {};
  }
  return text.data();
}

void add(int epoll, int descriptor, const void* who) {
  epoll_event event = {};
  event.events = EPOLLIN;
  event.data.ptr = const_cast<void*>(who);
  ::epoll_ctl(epoll, EPOLL_CTL_ADD, descriptor, &event);
}

}  // namespace

Doorman::Doorman(int listening, const DoormanLimits& limits, StreamOf stream_of, Admit admit,
                 TurnAway turn_away)
    : listening_(listening),
      limits_(limits),
      stream_of_(std::move(stream_of)),
      admit_(std::move(admit)),
      turn_away_(std::move(turn_away)),
      epoll_(new_epoll()) {
  ::fcntl(listening_, F_SETFL, ::fcntl(listening_, F_GETFL) | O_NONBLOCK);
  add(epoll_, listening_, this);
  add(epoll_, wakeup_.descriptor(), &wakeup_);
  thread_ = std::jthread([this] { work(); });
}

Doorman::~Doorman() {
  stop();
  ::close(epoll_);
}

void Doorman::stop() {
  stopping_ = true;
  wakeup_.ring();
  if (thread_.joinable()) thread_.join();
}

void Doorman::work() {
  std::array<epoll_event, kMostEvents> events = {};
  Clock::time_point last_tick = Clock::now();
  while (!stopping_) {
    const int count = ::epoll_wait(epoll_, events.data(), kMostEvents, kTickMilliseconds);
    bool has_new = false;
    for (int i = 0; i < count; ++i) {
      const void* who = events.at(static_cast<std::size_t>(i)).data.ptr;
      has_new = has_new || who == this;
      // Guests only join after the batch, so a closed one's address is nobody else's yet.
      const auto guest =
          std::ranges::find_if(guests_, [&](const Guest& each) { return &each == who; });
      if (guest != guests_.end()) serve(guest);
    }
    if (has_new) accept_some();
    if (Clock::now() - last_tick >= std::chrono::milliseconds(kTickMilliseconds)) {
      last_tick = Clock::now();
      close_overdue();
    }
  }
  guests_.clear();
  count_ = 0;
}

void Doorman::accept_some() {
  for (int n = 0; n < kMostAcceptedAtOnce && !stopping_; ++n) {
    sockaddr_storage peer = {};
    socklen_t size = sizeof peer;
    const int socket = ::accept4(listening_, reinterpret_cast<sockaddr*>(&peer), &size,
                                 SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (socket >= 0) {
      greet(socket, address_of(peer));
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Whoever has been silent for longest makes room; with nobody to send away, time does.
      if (guests_.empty()) {
        spdlog::warn("no descriptors are left for connections");
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return;
      }
      close(guests_.begin());
    } else if (errno != ECONNABORTED && errno != EINTR) {
      return;
    }
  }
}

void Doorman::greet(int socket, std::string address) {
  if (guests_.size() >= limits_.most_held) close(guests_.begin());
  Guest& guest = guests_.emplace_back();
  ++count_;
  guest.deadline = Clock::now() + limits_.head_time;
  guest.visitor.address = std::move(address);
  try {
    guest.visitor.stream = stream_of_(socket);
  } catch (const std::exception& error) {
    spdlog::warn("a connection could not be begun: {}", error.what());
    return close(std::prev(guests_.end()));
  }
  serve(std::prev(guests_.end()));
}

void Doorman::serve(Guests::iterator guest) {
  try {
    while (true) {
      const std::size_t before = guest->received.size();
      guest->received.resize(before + kBlock);
      const Transfer transfer =
          guest->visitor.stream->read(std::span(guest->received).subspan(before));
      guest->received.resize(before + transfer.bytes);
      bytes_ += transfer.bytes;
      if (transfer.state == Transfer::State::kClosed) {
        const bool is_silent = guest->received.empty() && !guest->has_head;
        return is_silent ? close(guest)
                         : send_away(guest, {ErrorCode::kInvalidParameter,
                                             "the request ended before it was complete"});
      }
      if (transfer.state != Transfer::State::kDone) return watch(guest, transfer.state);
      if (listen_to(*guest)) return let_in(guest);
      if (bytes_ > limits_.most_bytes) return make_room();
    }
  } catch (const Error& error) {
    send_away(guest, error);
  }
}

// True when all that is waited for has come. Throws what is wrong with the request.
bool Doorman::listen_to(Guest& guest) {
  if (!guest.has_head) {
    const auto size = guest.scanner.scan(guest.received);
    if (!size) return false;
    Visitor& visitor = guest.visitor;
    visitor.head = parse_head(std::string_view(guest.received).substr(0, *size));
    visitor.framing = framing_of(visitor.head);
    bytes_ -= *size;
    guest.received.erase(0, *size);
    guest.has_head = true;
    // Whoever asks first whether the body is wanted gets that answer from the one who knows.
    const std::uint64_t length = visitor.framing.length.value_or(0);
    const bool asks_first = visitor.head.find("Expect") != nullptr;
    guest.wanted = length <= limits_.small_body && !asks_first ? length : 0;
  }
  return guest.received.size() >= guest.wanted;
}

void Doorman::watch(Guests::iterator guest, Transfer::State wanted) {
  epoll_event event = {};
  event.events = wanted == Transfer::State::kWantsWrite ? EPOLLOUT : EPOLLIN;
  event.data.ptr = &*guest;
  const int operation = std::exchange(guest->is_watched, true) ? EPOLL_CTL_MOD : EPOLL_CTL_ADD;
  const int descriptor = guest->visitor.stream->descriptor();
  if (::epoll_ctl(epoll_, operation, descriptor, &event) != 0) close(guest);
}

// All are given the same time, so the first is the first to be overdue.
void Doorman::close_overdue() {
  const auto now = Clock::now();
  while (!guests_.empty() && now >= guests_.front().deadline) {
    if (guests_.front().received.empty() && !guests_.front().has_head) {
      close(guests_.begin());
    } else {
      send_away(guests_.begin(), {ErrorCode::kRequestTimeout, "the request did not come in time"});
    }
  }
}

void Doorman::make_room() {
  while (bytes_ > limits_.most_bytes && !guests_.empty()) close(guests_.begin());
}

void Doorman::let_in(Guests::iterator guest) {
  Visitor visitor = std::move(guest->visitor);
  visitor.body = std::move(guest->received);
  if (guest->is_watched) {
    ::epoll_ctl(epoll_, EPOLL_CTL_DEL, visitor.stream->descriptor(), nullptr);
  }
  bytes_ -= visitor.body.size();
  guests_.erase(guest);
  --count_;
  admit_(std::move(visitor));
}

void Doorman::send_away(Guests::iterator guest, const Error& error) {
  const std::unique_ptr<ByteStream>& stream = guest->visitor.stream;
  if (guest->is_watched) ::epoll_ctl(epoll_, EPOLL_CTL_DEL, stream->descriptor(), nullptr);
  turn_away_(std::move(guest->visitor.stream), guest->visitor.address, error);
  close(guest);
}

// Closing a stream takes it out of epoll.
void Doorman::close(Guests::iterator guest) {
  bytes_ -= guest->received.size();
  guests_.erase(guest);
  --count_;
}

}  // namespace isomesh::http
