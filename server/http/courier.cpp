#include "server/http/courier.h"

#include <algorithm>
#include <array>
#include <utility>

#include <sys/epoll.h>
#include <unistd.h>

namespace isomesh::http {
namespace {

constexpr int kMostEvents = 128;
constexpr int kTickMilliseconds = 1000;  // how often sources and deadlines are looked at
constexpr std::size_t kBytesPerTurn = std::size_t{1} << 20;  // then it is the next one's turn
constexpr std::size_t kMostIgnored = std::size_t{64} << 20;

}  // namespace

Courier::Courier(const CourierLimits& limits) : limits_(limits), epoll_(new_epoll()) {
  epoll_event event = {};
  event.events = EPOLLIN;
  event.data.ptr = nullptr;
  ::epoll_ctl(epoll_, EPOLL_CTL_ADD, wakeup_.descriptor(), &event);
  thread_ = std::jthread([this] { work(); });
}

Courier::~Courier() {
  stop(std::chrono::milliseconds(0));
  ::close(epoll_);
}

void Courier::send(Delivery delivery) {
  {
    const std::lock_guard lock(mutex_);
    if (end_ != Clock::time_point::max()) return;  // its stream is closed
    arrived_.push_back(std::move(delivery));
    ++count_;
  }
  wakeup_.ring();
}

void Courier::wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
  }
  wakeup_.ring();
}

void Courier::stop(std::chrono::milliseconds patience) {
  {
    const std::lock_guard lock(mutex_);
    end_ = std::min(end_, Clock::now() + patience);
  }
  wakeup_.ring();
  if (thread_.joinable()) thread_.join();
}

void Courier::work() {
  std::array<epoll_event, kMostEvents> events = {};
  Clock::time_point last_tick = Clock::now();
  while (true) {
    const Clock::time_point end = take_in();
    const auto now = Clock::now();
    if (ending_ || now - last_tick >= std::chrono::milliseconds(kTickMilliseconds)) {
      last_tick = now;
      ask_sources();
      close_overdue();
    }
    if (ending_ && (parcels_.empty() || now >= end)) break;
    const int patience = ending_ ? kTickMilliseconds / 20 : kTickMilliseconds;
    const int count = ::epoll_wait(epoll_, events.data(), kMostEvents, patience);
    for (int i = 0; i < count; ++i) serve_event(events.at(static_cast<std::size_t>(i)));
  }
  parcels_.clear();
  count_ = 0;
}

// Parcels only join between two batches of events, so a closed one's address is nobody else's yet.
void Courier::serve_event(const epoll_event& event) {
  if (event.data.ptr == nullptr) return wakeup_.clear();
  const auto parcel =
      std::ranges::find_if(parcels_, [&](const Parcel& each) { return &each == event.data.ptr; });
  if (parcel != parcels_.end()) serve(parcel, event.events);
}

// Returns when to end.
Courier::Clock::time_point Courier::take_in() {
  std::vector<Delivery> arrived;
  bool woken = false;
  Clock::time_point end;
  {
    const std::lock_guard lock(mutex_);
    arrived.swap(arrived_);
    woken = std::exchange(woken_, false);
    end = end_;
  }
  ending_ = end != Clock::time_point::max();
  for (Delivery& delivery : arrived) {
    if (parcels_.size() >= limits_.most_deliveries) close(parcels_.begin());
    Parcel& parcel = parcels_.emplace_back();
    parcel.delivery = std::move(delivery);
    parcel.deadline = Clock::now() + limits_.patience;
    serve(std::prev(parcels_.end()), 0);
  }
  if (woken) ask_sources();
  return end;
}

void Courier::serve(Parcels::iterator parcel, unsigned events) {
  const bool is_broken = (events & (EPOLLERR | EPOLLHUP)) != 0;
  const bool reader_is_gone = (events & EPOLLRDHUP) != 0;  // only watched for where it matters
  if (is_broken || reader_is_gone) return close(parcel);
  const bool goes_on = parcel->phase == Phase::kSending ? send_some(*parcel) : read_on(*parcel);
  if (!goes_on || !watch(*parcel)) close(parcel);
}

// Sends until the other side takes no more, there is nothing to send, or it is another's turn.
// False when the connection is to be closed.
bool Courier::send_some(Parcel& parcel) {
  std::string& bytes = parcel.delivery.bytes;
  for (std::size_t turn = 0; turn < kBytesPerTurn;) {
    if (parcel.sent == bytes.size()) {
      if (!refill(parcel)) return false;
      if (parcel.phase == Phase::kLingering) return read_on(parcel);
      if (parcel.waits_for_source) {
        parcel.events = parcel.delivery.source->ends_with_reader() ? EPOLLRDHUP : 0U;
        return true;
      }
    }
    const Transfer transfer =
        parcel.delivery.stream->write(std::string_view(bytes).substr(parcel.sent));
    if (transfer.state == Transfer::State::kClosed) return false;
    if (transfer.state != Transfer::State::kDone) {
      parcel.events = transfer.state == Transfer::State::kWantsRead ? EPOLLIN : EPOLLOUT;
      return true;
    }
    parcel.sent += transfer.bytes;
    turn += transfer.bytes;
    parcel.since_deadline += transfer.bytes;
    if (parcel.since_deadline >= kLeastBytes || parcel.sent == bytes.size()) {
      parcel.since_deadline = 0;
      parcel.deadline = Clock::now() + limits_.patience;
    }
  }
  parcel.events = EPOLLOUT;  // it can be written at once, after all others
  return true;
}

// The next bytes to send, or what follows when there are none. False when the connection is to be
// closed.
bool Courier::refill(Parcel& parcel) {
  Delivery& delivery = parcel.delivery;
  delivery.bytes.clear();
  parcel.sent = 0;
  parcel.waits_for_source = false;
  switch (delivery.source ? delivery.source->next(delivery.bytes) : Source::More::kEnd) {
    case Source::More::kBytes:
      return true;
    case Source::More::kLater:
      parcel.waits_for_source = true;
      return !ending_;
    case Source::More::kEnd:
      delivery.stream->finish_writing();
      parcel.phase = Phase::kLingering;
      parcel.deadline = Clock::now() + limits_.linger;
      return true;
    case Source::More::kBroken:
      break;
  }
  return false;
}

// Takes and forgets what the other side still sends. False when it has ended, or has sent enough.
bool Courier::read_on(Parcel& parcel) {
  std::array<char, 16 * 1024> ignored;
  for (std::size_t turn = 0; turn < kBytesPerTurn;) {
    const Transfer transfer = parcel.delivery.stream->read(ignored);
    if (transfer.state == Transfer::State::kClosed) return false;
    if (transfer.state != Transfer::State::kDone) break;
    turn += transfer.bytes;
    parcel.ignored += transfer.bytes;
    if (parcel.ignored > kMostIgnored) return false;
  }
  parcel.events = EPOLLIN;
  return true;
}

void Courier::ask_sources() {
  for (auto parcel = parcels_.begin(); parcel != parcels_.end();) {
    const auto next = std::next(parcel);
    if (parcel->waits_for_source) serve(parcel, 0);
    parcel = next;
  }
}

void Courier::close_overdue() {
  const auto now = Clock::now();
  for (auto parcel = parcels_.begin(); parcel != parcels_.end();) {
    const auto next = std::next(parcel);
    if (!parcel->waits_for_source && now >= parcel->deadline) close(parcel);
    parcel = next;
  }
}

bool Courier::watch(Parcel& parcel) {
  epoll_event event = {};
  event.events = parcel.events;
  event.data.ptr = &parcel;
  const int descriptor = parcel.delivery.stream->descriptor();
  const int operation = std::exchange(parcel.is_watched, true) ? EPOLL_CTL_MOD : EPOLL_CTL_ADD;
  return ::epoll_ctl(epoll_, operation, descriptor, &event) == 0;
}

// Closing the descriptor takes it out of epoll.
void Courier::close(Parcels::iterator parcel) {
  parcels_.erase(parcel);
  --count_;
}

}  // namespace isomesh::http
