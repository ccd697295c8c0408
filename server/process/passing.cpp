#include "server/process/passing.h"

#include <array>
#include <cstring>

#include <sys/socket.h>

namespace isomesh::process {
namespace {

struct Message {
  Message(void* bytes, std::size_t count) : content{bytes, count} {
    header.msg_iov = &content;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
  }
  Message(const Message&) = delete;
  Message& operator=(const Message&) = delete;

  iovec content;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control = {};
  msghdr header = {};
};

}  // namespace

ssize_t send_with(int socket, std::string_view bytes, int passed) {
  Message message(const_cast<char*>(bytes.data()), bytes.size());  // sendmsg only reads it
  cmsghdr* const part = CMSG_FIRSTHDR(&message.header);
  part->cmsg_level = SOL_SOCKET;
  part->cmsg_type = SCM_RIGHTS;
  part->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(part), &passed, sizeof(passed));
  return ::sendmsg(socket, &message.header, MSG_NOSIGNAL);
}

Received receive(int socket, std::span<char> target) {
  Message message(target.data(), target.size());
  Received received;
  received.count = ::recvmsg(socket, &message.header, MSG_CMSG_CLOEXEC);
  const cmsghdr* const part = received.count > 0 ? CMSG_FIRSTHDR(&message.header) : nullptr;
  if (part == nullptr || part->cmsg_type != SCM_RIGHTS) return received;
  int number = -1;
  std::memcpy(&number, CMSG_DATA(part), sizeof(number));
  received.passed = Descriptor(number);
  return received;
}

}  // namespace isomesh::process
