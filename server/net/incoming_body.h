// The body of a request, read from its connection while a handler works.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "server/net/acceptor.h"
#include "server/net/byte_stream.h"
#include "server/net/chunk_scanner.h"

namespace isomesh::net {

struct BodyLimits {
  // Within each such time IncomingBody::kLeastBytes must come, or all of the rest.
  std::chrono::milliseconds patience{15'000};
};

// The bytes after a request's head, as they are sent: a chunked body with the sizes of its chunks.
// Owns the connection. Not thread safe; one thread after the other may use it.
class IncomingBody {
 public:
  static constexpr std::size_t kLeastBytes = 64 * 1024;

  // Reading ends when `stopping` becomes true. The head of the connection is not looked at later.
  IncomingBody(Connection& connection, const BodyLimits& limits, const std::atomic<bool>& stopping);

  // Waits for some bytes and returns how many came: 0 when the other side has ended, nothing when
  // they come too slowly, are no chunks where they should be, or the service stops. Invites the
  // body of a client that asked whether it is wanted (Expect: 100-continue).
  std::optional<std::size_t> read(std::span<char> target);

  // Bytes that have come, also those that came with the head.
  std::uint64_t received() const { return received_; }

  // Whether all of it has come; never true for a chunked one, whose end is not looked for here.
  bool is_whole() const { return !framing_.chunked && received_ >= framing_.length.value_or(0); }

  // Whether it ended because its chunks are none.
  bool was_malformed() const { return was_malformed_; }

  // Whether it ended because it came too slowly.
  bool was_too_slow() const { return was_too_slow_; }

  // The descriptor of the connection, until that is taken.
  int descriptor() const { return stream_->descriptor(); }

  // The connection, for the response; nothing is read any more.
  std::unique_ptr<ByteStream> take_stream() { return std::move(stream_); }

 private:
  void invite();
  bool is_well_formed(std::string_view bytes);

  std::unique_ptr<ByteStream> stream_;
  const BodyFraming framing_;
  const std::string begin_;  // what came with the head
  const BodyLimits limits_;
  const std::atomic<bool>& stopping_;
  bool waits_for_invitation_ = false;
  std::size_t begin_read_ = 0;  // of begin_
  std::uint64_t received_ = 0;
  std::size_t since_deadline_ = 0;
  std::optional<std::chrono::steady_clock::time_point> deadline_;  // once reading has begun
  bool was_too_slow_ = false;
  ChunkScanner chunks_;
  bool was_malformed_ = false;
};

}  // namespace isomesh::net
