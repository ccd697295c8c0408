// A request's body, read from its connection in the handler.
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
#include "server/net/chunk_decoder.h"

namespace isomesh::net {

struct BodyLimits {
  // In each period of this length at least IncomingBody::kLeastBytes must arrive, or the whole
  // rest.
  std::chrono::milliseconds patience{15'000};
};

// The body after a request's head, without the framing of its chunks and without trailer fields.
// Owns the connection. Not thread safe, but may move between threads.
class IncomingBody {
 public:
  static constexpr std::size_t kLeastBytes = 64 * 1024;

  // Reading ends when `stopping` becomes true. Does not refer to the connection's head later.
  IncomingBody(Connection& connection, const BodyLimits& limits, const std::atomic<bool>& stopping);

  // Waits for bytes and returns their number: 0 at the end of the body, empty if the client closes
  // before, if they come too slowly, if chunks are malformed, or if the service stops. Invites the
  // body of a client that sent Expect: 100-continue.
  std::optional<std::size_t> read(std::span<char> target);

  // Bytes received, including those that came with the head, and the framing of chunks.
  std::uint64_t received() const { return received_; }

  // True if all bytes have arrived; for a chunked body only once its end was read.
  bool is_whole() const {
    return framing_.chunked ? chunks_.is_over() : received_ >= framing_.length.value_or(0);
  }

  bool was_malformed() const { return was_malformed_; }

  bool was_too_slow() const { return was_too_slow_; }

  // True if the client closed before a read, that is, before the end of the body.
  bool was_cut() const { return was_cut_; }

  // The connection's descriptor, until take_stream().
  int descriptor() const { return stream_->descriptor(); }

  // Releases the connection, for the response. Do not read afterwards.
  std::unique_ptr<ByteStream> take_stream() { return std::move(stream_); }

 private:
  void invite();
  std::optional<std::size_t> receive(std::span<char> target);

  std::unique_ptr<ByteStream> stream_;
  const BodyFraming framing_;
  const std::string begin_;
  const BodyLimits limits_;
  const std::atomic<bool>& stopping_;
  bool waits_for_invitation_ = false;
  std::size_t begin_read_ = 0;
  std::uint64_t received_ = 0;
  std::size_t since_deadline_ = 0;
  std::optional<std::chrono::steady_clock::time_point> deadline_;  // set by the first read
  bool was_too_slow_ = false;
  std::uint64_t left_ = 0;  // bytes of a body of known length that were not read
  ChunkDecoder chunks_;
  bool was_malformed_ = false;
  bool was_cut_ = false;
};

}  // namespace isomesh::net
