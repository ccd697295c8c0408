#include "server/net/byte_stream.h"

#include <cerrno>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace isomesh::net {
namespace {

Transfer outcome(ssize_t count, Transfer::State would_block) {
  if (count > 0) return {Transfer::State::kDone, static_cast<std::size_t>(count)};
  const bool later = count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
  return {later ? would_block : Transfer::State::kClosed, 0};
}

}  // namespace

PlainStream::PlainStream(int socket) : socket_(socket) {
  ::fcntl(socket_, F_SETFL, ::fcntl(socket_, F_GETFL) | O_NONBLOCK);
}

PlainStream::~PlainStream() { ::close(socket_); }

Transfer PlainStream::read(std::span<char> target) {
  return outcome(::recv(socket_, target.data(), target.size(), 0), Transfer::State::kWantsRead);
}

Transfer PlainStream::write(std::string_view bytes) {
  return outcome(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL),
                 Transfer::State::kWantsWrite);
}

void PlainStream::finish_writing() { ::shutdown(socket_, SHUT_WR); }

bool wait_for(const ByteStream& stream, Transfer::State wanted, int milliseconds) {
  const short events = wanted == Transfer::State::kWantsWrite ? POLLOUT : POLLIN;
  pollfd waiting = {stream.descriptor(), events, 0};
  return ::poll(&waiting, 1, milliseconds) != 0;
}

}  // namespace isomesh::net
