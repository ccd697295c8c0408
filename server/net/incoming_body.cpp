#include "server/net/incoming_body.h"

#include <algorithm>
#include <utility>

#include "base/text.h"

namespace isomesh::net {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kStopMilliseconds = 100;  // interval between checks whether the service stops

bool asks_first(const RequestHead& head) {
  const std::string* expect = find_header(head.headers, "Expect");
  return expect != nullptr && lower(*expect) == "100-continue";
}

}  // namespace

IncomingBody::IncomingBody(Connection& connection, const BodyLimits& limits,
                           const std::atomic<bool>& stopping)
    : stream_(std::move(connection.stream)),
      framing_(connection.framing),
      begin_(std::move(connection.body)),
      limits_(limits),
      stopping_(stopping),
      waits_for_invitation_(begin_.empty() && asks_first(connection.head)),
      received_(begin_.size()),
      left_(framing_.length.value_or(0)) {}

std::optional<std::size_t> IncomingBody::read(std::span<char> target) {
  if (!framing_.chunked) {
    if (left_ == 0) return 0;
    const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(left_, target.size()));
    const auto count = receive(target.first(most));
    left_ -= count.value_or(0);
    return count;
  }
  while (!chunks_.is_over() && !was_malformed_) {
    const auto count = receive(target);
    if (!count) return std::nullopt;
    const auto data = chunks_.decode(target.first(*count));
    was_malformed_ = !data;
    if (data.value_or(0) > 0) return data;
  }
  return was_malformed_ ? std::nullopt : std::optional<std::size_t>(0);
}

// Waits for bytes as sent, of which there are some in what it returns.
std::optional<std::size_t> IncomingBody::receive(std::span<char> target) {
  if (begin_read_ < begin_.size()) {
    const std::size_t count = begin_.copy(target.data(), target.size(), begin_read_);
    begin_read_ += count;
    return count;
  }
  if (std::exchange(waits_for_invitation_, false)) invite();
  if (!deadline_) deadline_ = Clock::now() + limits_.patience;
  while (true) {
    const Transfer transfer = stream_->read(target);
    if (transfer.state == Transfer::State::kClosed) {
      was_cut_ = true;
      return std::nullopt;
    }
    if (transfer.state == Transfer::State::kDone) {
      received_ += transfer.bytes;
      since_deadline_ += transfer.bytes;
      if (since_deadline_ >= kLeastBytes) {
        since_deadline_ = 0;
        deadline_ = Clock::now() + limits_.patience;
      }
      return transfer.bytes;
    }
    was_too_slow_ = Clock::now() >= *deadline_;
    if (stopping_ || was_too_slow_) return std::nullopt;
    wait_for(*stream_, transfer.state, kStopMilliseconds);
  }
}

// The first bytes in this direction always fit the socket's buffer. If they were lost, the client
// would send its body anyway, after a while.
void IncomingBody::invite() { stream_->write("HTTP/1.1 100 Continue\r\n\r\n"); }

}  // namespace isomesh::net
