#include "server/net/sender.h"

#include <algorithm>
#include <array>
#include <exception>
#include <limits>
#include <utility>

#include <sys/epoll.h>
#include <unistd.h>

#include "base/log.h"
#include "base/niceness.h"

namespace isomesh::net {
namespace {

constexpr int kMostEvents = 128;
constexpr int kTickMilliseconds = 1000;  // interval between checks of sources and deadlines
constexpr std::size_t kBytesPerTurn = std::size_t{1} << 20;  // per response before the next one is
                                                             // served
constexpr std::size_t kMostIgnored = std::size_t{64} << 20;
constexpr std::uint64_t kWakeup = 0;  // epoll's id; responses have higher ids

// An exception of one source must not end the thread that serves all.
Source::More next_of(Source& source, std::string& bytes) {
  try {
    return source.next(bytes);
  } catch (const std::exception& error) {
    log_error("a response was cut off by an error: {}", error.what());
    return Source::More::kBroken;
  }
}

// Writes as much as the connection takes without blocking, and removes it from the bytes. Returns
// true if the connection is complete and can be closed.
bool is_sent(Response& response, bool request_is_whole) {
  std::string_view left = response.bytes;
  while (!left.empty()) {
    const Transfer transfer = response.stream->write(left);
    if (transfer.state == Transfer::State::kClosed) return true;
    if (transfer.state != Transfer::State::kDone) break;
    left.remove_prefix(transfer.bytes);
  }
  response.bytes.erase(0, response.bytes.size() - left.size());
  if (!left.empty() || response.source || !request_is_whole) return false;
  response.stream->finish_writing();
  std::array<char, 1> more = {};  // no bytes may follow the request
  return response.stream->read(more).state != Transfer::State::kDone;
}

}  // namespace

// Each response has at most one computed piece at a time, so the queue needs no bound.
Sender::Sender(const SenderLimits& limits)
    : limits_(limits),
      epoll_(new_epoll()),
      computing_(limits.computing_threads, std::numeric_limits<std::size_t>::max(),
                 kComputingNiceness) {
  watch_or_throw(epoll_.number(), wakeup_.descriptor(), EPOLLIN, kWakeup);
  thread_ = std::jthread([this] { work(); });
}

Sender::~Sender() { stop(std::chrono::milliseconds(0)); }

void Sender::send(Response response, bool request_is_whole) {
  if (is_sent(response, request_is_whole)) return;
  {
    const Lock lock(mutex_);
    if (end_ != Clock::time_point::max()) return;  // destroys the stream, which closes it
    held_bytes_ += response.bytes.size();
    arrived_.push_back(std::move(response));
    ++count_;
  }
  wakeup_.ring();
}

void Sender::wake() {
  {
    const Lock lock(mutex_);
    woken_ = true;
  }
  wakeup_.ring();
}

void Sender::stop(std::chrono::milliseconds patience) {
  {
    const Lock lock(mutex_);
    end_ = std::min(end_, Clock::now() + patience);
  }
  wakeup_.ring();
  if (thread_.joinable()) thread_.join();
}

void Sender::work() {
  std::array<epoll_event, kMostEvents> events = {};
  Clock::time_point last_tick = Clock::now();
  while (true) {
    const Clock::time_point end = take_arrived();
    const auto now = Clock::now();
    if (ending_ || now - last_tick >= std::chrono::milliseconds(kTickMilliseconds)) {
      last_tick = now;
      ask_sources();
      close_overdue();
    }
    if (ending_ && (by_id_.empty() || now >= end)) break;
    const int patience = ending_ ? kTickMilliseconds / 20 : kTickMilliseconds;
    const int count = ::epoll_wait(epoll_.number(), events.data(), kMostEvents, patience);
    for (int i = 0; i < count; ++i) serve_event(events.at(static_cast<std::size_t>(i)));
  }
  by_id_.clear();
  sending_.clear();
  parting_.clear();
  count_ = 0;
  held_bytes_ = 0;
}

void Sender::serve_event(const epoll_event& event) {
  const std::uint64_t id = event.data.u64;  // a copy: the kernel's struct is packed
  if (id == kWakeup) {
    wakeup_.clear();
    return;
  }
  const auto sending = by_id_.find(id);  // may have been closed in this batch
  if (sending != by_id_.end()) go_on(sending->second, event.events);
}

Sender::Clock::time_point Sender::take_arrived() {
  std::vector<Response> arrived;
  std::vector<Computed> computed;
  bool woken = false;
  Clock::time_point end;
  {
    const Lock lock(mutex_);
    arrived.swap(arrived_);
    computed.swap(computed_);
    woken = std::exchange(woken_, false);
    end = end_;
  }
  ending_ = end != Clock::time_point::max();
  for (Response& response : arrived) begin(std::move(response));
  for (Computed& each : computed) take_computed(std::move(each));
  if (woken) ask_sources();
  return end;
}

void Sender::begin(Response response) {
  const auto sending = sending_.emplace(sending_.end());
  sending->id = ++last_id_;
  sending->response = std::move(response);
  sending->held = sending->response.bytes.size();
  sending->deadline = Clock::now() + limits_.patience;
  by_id_.emplace(sending->id, sending);
  if (sending->response.is_refusal) part(*sending);
  go_on(sending, 0);
}

// If the receiver has disconnected, the source and its bytes are destroyed.
void Sender::take_computed(Computed computed) {
  const auto found = by_id_.find(computed.id);
  if (found == by_id_.end()) return;
  const auto sending = found->second;
  sending->is_computed = false;
  sending->response.source = std::move(computed.source);
  sending->response.bytes = std::move(computed.bytes);
  sending->deadline = Clock::now() + limits_.patience;
  if (!go_on_with(*sending, computed.more)) return close(sending);
  go_on(sending, 0);
}

void Sender::go_on(SendingList::iterator sending, unsigned events) {
  const bool is_broken = (events & (EPOLLERR | EPOLLHUP)) != 0;
  const bool reader_is_gone = (events & EPOLLRDHUP) != 0;  // only watched if it matters
  if (is_broken || reader_is_gone) return close(sending);
  if (sending->is_computed) return;
  const bool goes_on =
      sending->phase == Phase::kSending ? send_some(*sending) : ignore_input(*sending);
  if (!goes_on || !watch(*sending)) close(sending);
}

// Sends until the peer takes no more, nothing is left, or its turn is over. Returns false if the
// connection must be closed.
bool Sender::send_some(Sending& sending) {
  std::string& bytes = sending.response.bytes;
  for (std::size_t turn = 0; turn < kBytesPerTurn;) {
    if (sending.sent == bytes.size()) {
      if (!refill(sending)) return false;
      if (sending.phase == Phase::kLingering) return ignore_input(sending);
      if (sending.waits_for_source || sending.is_computed) return true;
      if (bytes.empty()) continue;
    }
    const Transfer transfer =
        sending.response.stream->write(std::string_view(bytes).substr(sending.sent));
    if (transfer.state == Transfer::State::kClosed) return false;
    if (transfer.state != Transfer::State::kDone) {
      sending.events = transfer.state == Transfer::State::kWantsRead ? EPOLLIN : EPOLLOUT;
      return true;
    }
    sending.sent += transfer.bytes;
    turn += transfer.bytes;
    sending.since_deadline += transfer.bytes;
    if (sending.since_deadline >= kLeastBytes || sending.sent == bytes.size()) {
      sending.since_deadline = 0;
      sending.deadline = Clock::now() + limits_.patience;
    }
  }
  sending.events = EPOLLOUT;  // writable immediately, after all others
  return true;
}

// Gets the next bytes to send, or handles the end of the response. Returns false if the connection
// must be closed.
bool Sender::refill(Sending& sending) {
  Response& response = sending.response;
  let_go(sending);
  sending.sent = 0;
  sending.waits_for_source = false;
  if (!response.source) return go_on_with(sending, Source::More::kEnd);
  sending.events = response.source->ends_with_reader() ? EPOLLRDHUP : 0U;
  if (response.source->computes()) return have_computed(sending);
  return go_on_with(sending, next_of(*response.source, response.bytes));
}

// Frees a complete response's memory, though its connection may linger.
void Sender::let_go(Sending& sending) {
  held_bytes_ -= std::exchange(sending.held, 0);
  sending.response.bytes.clear();
  if (!sending.response.source) sending.response.bytes.shrink_to_fit();
}

// Handles the source's result, after its bytes were appended. Returns as above.
bool Sender::go_on_with(Sending& sending, Source::More more) {
  switch (more) {
    case Source::More::kBytes:
      return true;
    case Source::More::kLater:
      sending.waits_for_source = true;
      return !ending_;
    case Source::More::kEnd:
      sending.response.stream->finish_writing();
      sending.phase = Phase::kLingering;
      sending.deadline = Clock::now() + limits_.linger;
      part(sending);
      return true;
    case Source::More::kBroken:
      break;
  }
  return false;
}

bool Sender::have_computed(Sending& sending) {
  sending.is_computed = true;
  Response& response = sending.response;
  // Tasks are copied, but sources cannot be.
  const auto source = std::make_shared<std::unique_ptr<Source>>(std::move(response.source));
  const auto bytes = std::make_shared<std::string>(std::exchange(response.bytes, {}));
  return computing_.try_enqueue(response.party, [this, id = sending.id, source, bytes] {
    compute(id, std::move(*source), std::move(*bytes));
  });
}

void Sender::compute(std::uint64_t id, std::unique_ptr<Source> source, std::string bytes) {
  const Source::More more = next_of(*source, bytes);
  {
    const Lock lock(mutex_);
    computed_.push_back({id, std::move(source), more, std::move(bytes)});
  }
  wakeup_.ring();
}

// Connections with a complete response, or rejected, make room for others.
void Sender::part(Sending& sending) {
  if (sending.is_parting) return;
  sending.is_parting = true;
  if (parting_.size() >= limits_.most_parting) close(parting_.begin());
  parting_.splice(parting_.end(), sending_, by_id_.at(sending.id));
}

// Reads and discards the peer's bytes. Returns false if it has closed, or has sent too much.
bool Sender::ignore_input(Sending& sending) {
  std::array<char, 16 * 1024> ignored;
  for (std::size_t turn = 0; turn < kBytesPerTurn;) {
    const Transfer transfer = sending.response.stream->read(ignored);
    if (transfer.state == Transfer::State::kClosed) return false;
    if (transfer.state != Transfer::State::kDone) break;
    turn += transfer.bytes;
    sending.ignored += transfer.bytes;
    if (sending.ignored > kMostIgnored) return false;
  }
  sending.events = EPOLLIN;
  return true;
}

void Sender::ask_sources() {
  for (auto sending = sending_.begin(); sending != sending_.end();) {
    const auto next = std::next(sending);
    if (sending->waits_for_source) go_on(sending, 0);
    sending = next;
  }
}

void Sender::close_overdue() {
  const auto now = Clock::now();
  for (SendingList* const list : {&sending_, &parting_}) {
    for (auto sending = list->begin(); sending != list->end();) {
      const auto next = std::next(sending);
      const bool is_waited_for = sending->waits_for_source || sending->is_computed;
      if (!is_waited_for && now >= sending->deadline) close(sending);
      sending = next;
    }
  }
}

bool Sender::watch(Sending& sending) {
  return isomesh::watch(epoll_.number(), sending.response.stream->descriptor(), sending.events,
                        sending.id, std::exchange(sending.is_watched, true));
}

// Closing the descriptor removes it from epoll.
void Sender::close(SendingList::iterator sending) {
  by_id_.erase(sending->id);
  let_go(*sending);
  (sending->is_parting ? parting_ : sending_).erase(sending);
  --count_;
}

}  // namespace isomesh::net
