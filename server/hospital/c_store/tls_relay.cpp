#include "server/hospital/c_store/tls_relay.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>

#include "base/error.h"
#include "server/process/child.h"

namespace isomesh::c_store {
namespace {

using net::ByteStream;
using net::Transfer;
using State = Transfer::State;

// For the last bytes of an association: a peer that takes none holds up nothing.
constexpr std::chrono::seconds kLastBytes{2};

// A direction waits for these events of poll().
struct Waits {
  short source = 0;
  short sink = 0;
};

short events_of(State state) {
  if (state == State::kWantsRead) return POLLIN;
  return state == State::kWantsWrite ? POLLOUT : 0;
}

// Carries bytes one way.
class Direction {
 public:
  Direction(ByteStream& source, ByteStream& sink) : source_(source), sink_(sink) {}

  // Returns true if bytes moved, or the end was found.
  bool step(Waits& waits) {
    if (is_over()) return false;
    if (rest_.empty()) {
      const Transfer read = source_.read(buffer_);
      has_ended_ = read.state == State::kClosed;
      if (read.state != State::kDone) {
        waits.source = events_of(read.state);
        return has_ended_;
      }
      rest_ = std::string_view(buffer_.data(), read.bytes);
    }
    const Transfer written = sink_.write(rest_);
    is_broken_ = written.state == State::kClosed;
    if (written.state == State::kDone) {
      rest_.remove_prefix(written.bytes);
      has_moved_ = true;
    }
    waits.sink = events_of(written.state);
    return written.state == State::kDone || is_broken_;
  }

  bool has_ended() const { return has_ended_; }  // the source, and all of it was written
  bool is_broken() const { return is_broken_; }  // the sink takes no more
  bool is_over() const { return has_ended_ || is_broken_; }
  bool has_moved() const { return has_moved_; }

 private:
  static constexpr std::size_t kBytes = 32 * 1024;

  ByteStream& source_;
  ByteStream& sink_;
  std::array<char, kBytes> buffer_ = {};
  std::string_view rest_;  // of the buffer, to be written
  bool has_ended_ = false;
  bool is_broken_ = false;
  bool has_moved_ = false;
};

}  // namespace

TlsRelay::TlsRelay(std::unique_ptr<net::TlsStream> peer) : peer_(std::move(peer)) {
  process::SocketPair pair = process::make_socket_pair();
  plain_end_ = std::move(pair.theirs);
  plain_ = std::make_unique<net::PlainStream>(pair.ours.release());
  try {
    thread_ = std::jthread([this] { run(); });
  } catch (const std::system_error& error) {
    throw Error(ErrorCode::kInternal, std::string("no thread for TLS: ") + error.what());
  }
}

TlsRelay::~TlsRelay() {
  // The thread reads what is left, and then the end.
  ::shutdown(plain_->descriptor(), SHUT_RDWR);
  thread_.join();
}

bool TlsRelay::is_certified_as(const std::string& name) const {
  const Lock lock(mutex_);
  if (!certificate_) return false;
  constexpr unsigned kFlags = X509_CHECK_FLAG_NO_WILDCARDS;
  return X509_check_host(certificate_.get(), name.c_str(), name.size(), kFlags, nullptr) == 1 ||
         X509_check_ip_asc(certificate_.get(), name.c_str(), 0) == 1;
}

void TlsRelay::run() {
  if (shake_hands()) {
    note_certificate();
    carry();
  }
  peer_->finish_writing();
  fault_ = peer_->fault();
  if (fault_ != net::TlsFault::kNone) linger();
  ::shutdown(plain_->descriptor(), SHUT_RDWR);
}

bool TlsRelay::shake_hands() {
  while (true) {
    const Transfer done = peer_->shake_hands();
    if (done.state == State::kDone) return true;
    has_ended_silently_ = done.state == State::kClosed;
    if (done.state == State::kClosed || !await(events_of(done.state), 0)) return false;
  }
}

void TlsRelay::note_certificate() {
  const Lock lock(mutex_);
  certificate_.reset(SSL_get1_peer_certificate(peer_->ssl()), &X509_free);
}

void TlsRelay::carry() {
  Direction in(*peer_, *plain_);
  Direction out(*plain_, *peer_);
  std::optional<Clock::time_point> deadline;  // once the plain end is closed
  while (!out.is_over() && (!deadline || Clock::now() < *deadline)) {
    Waits in_waits;
    Waits out_waits;
    const bool was_open = !in.is_over();
    const bool in_moved = in.step(in_waits);
    if (was_open && in.has_ended()) {
      has_ended_silently_ = !in.has_moved();
      if (peer_->fault() != net::TlsFault::kNone) return;
      plain_->finish_writing();
    }
    const bool out_moved = out.step(out_waits);
    has_answered_ = out.has_moved();
    if (in_moved || out_moved) {
      moved_ = Clock::now();
      continue;
    }
    const bool is_open = await(static_cast<short>(in_waits.source | out_waits.sink),
                               static_cast<short>(in_waits.sink | out_waits.source), deadline,
                               !deadline.has_value());
    // Its last bytes are still sent, unless the peer takes too long.
    if (!is_open) deadline = Clock::now() + kLastBytes;
  }
  // A peer that has closed the connection may have said why.
  Waits unused;
  if (out.is_broken()) in.step(unused);
  has_ended_silently_ = in.has_ended() && !in.has_moved();
}

// A connection that is closed with unread bytes is reset, and the peer could lose the alert that
// says why.
void TlsRelay::linger() const {
  const auto deadline = Clock::now() + kLastBytes;
  std::array<char, 4096> rest = {};
  while (Clock::now() < deadline) {
    const ssize_t count = ::recv(peer_->descriptor(), rest.data(), rest.size(), MSG_DONTWAIT);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) return;
    if (count < 0 && !await(POLLIN, 0, deadline)) return;
  }
}

bool TlsRelay::await(short peer_events, short plain_events,
                     std::optional<Clock::time_point> deadline, bool is_plain_open) const {
  // poll() reports a hang-up also without events to wait for. That of the peer is no news then.
  std::array<pollfd, 2> waiting = {
      pollfd{peer_events == 0 ? -1 : peer_->descriptor(), peer_events, 0},
      pollfd{is_plain_open ? plain_->descriptor() : -1, plain_events, 0}};
  int milliseconds = -1;
  if (deadline) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(*deadline - Clock::now());
    milliseconds = static_cast<int>(std::max<std::int64_t>(left.count(), 0));
  }
  ::poll(waiting.data(), waiting.size(), milliseconds);
  return (waiting[1].revents & POLLHUP) == 0;
}

}  // namespace isomesh::c_store
