// TLS for isomesh-dimse, which gets a plain socket: it parses what peers send, so it must not know
// a private key.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "base/descriptor.h"
#include "base/mutex.h"
#include "server/net/tls_stream.h"

using X509 = struct x509_st;  // NOLINT: OpenSSL's name

namespace isomesh::c_store {

// Passes the bytes of one connection between a TLS peer and a plain socket, in a thread of its own,
// with a small buffer for each direction. The handshake has no limit of time here: whoever has the
// plain end closes it when too little comes.
class TlsRelay {
 public:
  using Clock = std::chrono::steady_clock;

  // Starts at once. Throws Error kInternal.
  explicit TlsRelay(std::unique_ptr<net::TlsStream> peer);
  // Bytes that were written to the plain end still get to the peer, if that takes them soon.
  ~TlsRelay();
  TlsRelay(const TlsRelay&) = delete;
  TlsRelay& operator=(const TlsRelay&) = delete;

  // A blocking socket. Call once.
  Descriptor take_plain_end() { return std::move(plain_end_); }

  // Why the connection failed; kNone if it has not, or has just ended. Set before the plain end
  // shows the end. Thread safe, as are the next ones.
  net::TlsFault fault() const { return fault_; }

  // True if the peer has ended the connection before it sent a byte of DICOM.
  bool has_ended_silently() const { return has_ended_silently_; }

  // True if the peer has a certificate for that name. For use after the peer's first byte.
  bool is_certified_as(const std::string& name) const;

  // True if this side has sent a byte of DICOM.
  bool has_answered() const { return has_answered_; }

  // The time since either side sent such a byte.
  Clock::duration idle() const { return Clock::now() - moved_.load(); }

 private:
  void run();
  bool shake_hands();  // false if that failed
  void carry();
  void note_certificate();
  void linger() const;
  // Waits for events of poll(). Returns false if the plain end turns out to be closed.
  bool await(short peer_events, short plain_events, std::optional<Clock::time_point> deadline = {},
             bool is_plain_open = true) const;

  const std::unique_ptr<net::TlsStream> peer_;
  Descriptor plain_end_;
  std::unique_ptr<net::PlainStream> plain_;
  std::atomic<net::TlsFault> fault_ = net::TlsFault::kNone;
  std::atomic<bool> has_ended_silently_ = false;
  std::atomic<bool> has_answered_ = false;
  std::atomic<Clock::time_point> moved_ = Clock::now();
  mutable Mutex mutex_;
  std::shared_ptr<X509> certificate_ ISOMESH_GUARDED_BY(mutex_);  // of the peer
  std::jthread thread_;                                           // last: uses all other members
};

}  // namespace isomesh::c_store
