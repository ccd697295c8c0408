// A connection as a stream of bytes, plain or encrypted.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace isomesh::net {

struct Transfer {
  enum class State {
    kDone,       // some bytes were transferred
    kWantsRead,  // none yet: retry when the descriptor is readable
    kWantsWrite,
    kClosed,  // closed by the peer, or broken
  };
  State state = State::kClosed;
  std::size_t bytes = 0;
};

// Never blocks, so one thread can serve many. An encrypted stream performs its handshake within
// read and write, which then may want the other direction. Not thread safe, but may move between
// threads.
class ByteStream {
 public:
  virtual ~ByteStream() = default;

  // The descriptor to poll.
  virtual int descriptor() const = 0;

  // Reads at most `target.size()` bytes, which is at least 1.
  virtual Transfer read(std::span<char> target) = 0;

  // Writes a prefix of `bytes`, which must not be empty.
  virtual Transfer write(std::string_view bytes) = 0;

  // Tells the peer that no more bytes follow; its bytes can still be read.
  virtual void finish_writing() = 0;
};

// A plain socket, which it owns and makes non-blocking.
class PlainStream : public ByteStream {
 public:
  explicit PlainStream(int socket);
  ~PlainStream() override;
  PlainStream(const PlainStream&) = delete;
  PlainStream& operator=(const PlainStream&) = delete;

  int descriptor() const override { return socket_; }
  Transfer read(std::span<char> target) override;
  Transfer write(std::string_view bytes) override;
  void finish_writing() override;

 private:
  const int socket_;
};

// Makes the stream of an accepted socket and takes its ownership. Must not block. May throw, and
// then has closed the socket.
using StreamOf = std::function<std::unique_ptr<ByteStream>(int socket)>;

// Waits until the transfer may continue. Returns false after `milliseconds`.
bool wait_for(const ByteStream& stream, Transfer::State wanted, int milliseconds);

}  // namespace isomesh::net
