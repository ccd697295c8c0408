#include "server/net/incoming_body.h"

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
      received_(begin_.size()) {}

std::optional<std::size_t> IncomingBody::read(std::span<char> target) {
  if (begin_read_ < begin_.size()) {
    const std::size_t count = begin_.copy(target.data(), target.size(), begin_read_);
    begin_read_ += count;
    if (!is_well_formed({target.data(), count})) return std::nullopt;
    return count;
  }
  if (std::exchange(waits_for_invitation_, false)) invite();
  if (!deadline_) deadline_ = Clock::now() + limits_.patience;
  while (true) {
    const Transfer transfer = stream_->read(target);
    if (transfer.state == Transfer::State::kClosed) {
      was_cut_ = true;
      return 0;
    }
    if (transfer.state == Transfer::State::kDone) {
      received_ += transfer.bytes;
      since_deadline_ += transfer.bytes;
      if (since_deadline_ >= kLeastBytes) {
        since_deadline_ = 0;
        deadline_ = Clock::now() + limits_.patience;
      }
      if (!is_well_formed({target.data(), transfer.bytes})) return std::nullopt;
      return transfer.bytes;
    }
    was_too_slow_ = Clock::now() >= *deadline_;
    if (stopping_ || was_too_slow_) return std::nullopt;
    wait_for(*stream_, transfer.state, kStopMilliseconds);
  }
}

bool IncomingBody::is_well_formed(std::string_view bytes) {
  if (framing_.chunked && !chunks_.scan(bytes)) was_malformed_ = true;
  return !was_malformed_;
}

// The first bytes in this direction always fit the socket's buffer. If they were lost, the client
// would send its body anyway, after a while.
void IncomingBody::invite() { stream_->write("HTTP/1.1 100 Continue\r\n\r\n"); }

}  // namespace isomesh::net
