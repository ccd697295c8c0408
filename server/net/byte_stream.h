// A connection as bytes that come and go, in plain or encrypted.
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
    kDone,       // some bytes went over
    kWantsRead,  // none yet: when the descriptor can be read, there may be some
    kWantsWrite,
    kClosed,  // the other side has ended it, or it broke
  };
  State state = State::kClosed;
  std::size_t bytes = 0;
};

// Never blocks, so that one thread can look after many. An encrypted one shakes hands on the way,
// within read and write, which then may want the other direction. Not thread safe; one thread after
// the other may use it.
class ByteStream {
 public:
  virtual ~ByteStream() = default;

  // What to wait on.
  virtual int descriptor() const = 0;

  // At most as many bytes as there is room for, which is at least one.
  virtual Transfer read(std::span<char> target) = 0;

  // The first of `bytes`, which are not empty.
  virtual Transfer write(std::string_view bytes) = 0;

  // Tells the other side that nothing more will come; what it still sends can be read.
  virtual void finish_writing() = 0;
};

// A socket in plain, which it owns and makes non-blocking.
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

// Makes the stream of an accepted socket, which it owns from then on. Must not block; may throw,
// and then has closed the socket.
using StreamOf = std::function<std::unique_ptr<ByteStream>(int socket)>;

// Waits until the transfer may go on. False when `milliseconds` are over.
bool wait_for(const ByteStream& stream, Transfer::State wanted, int milliseconds);

}  // namespace isomesh::net
