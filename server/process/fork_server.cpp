#include "server/process/fork_server.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <utility>

#include <linux/sched.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/error.h"
#include "base/niceness.h"
#include "proto/error.h"
#include "server/process/passing.h"

namespace isomesh::process {
namespace {

using Clock = std::chrono::steady_clock;

// Initialisation takes tens of milliseconds, on a busy machine hundreds. Restarting it earlier
// would not be faster.
constexpr std::chrono::seconds kLongestResponse{60};

// Returns none if the peer has closed.
Descriptor receive_descriptor() {
  std::array<char, 1> byte = {};
  for (;;) {
    Received received = receive(kChildDescriptor, byte);
    if (received.count < 0 && errno == EINTR) continue;
    return std::move(received.passed);
  }
}

// The C library's fork cannot create a sibling. Its additional work concerns other threads, and
// there are none.
pid_t fork_sibling() {
  return static_cast<pid_t>(
      ::syscall(SYS_clone, CLONE_PARENT | SIGCHLD, nullptr, nullptr, nullptr, nullptr));
}

// Sends the copy's id, or the negative error number.
[[nodiscard]] bool respond(std::int32_t number) {
  return ::send(kChildDescriptor, &number, sizeof(number), MSG_NOSIGNAL) == sizeof(number);
}

// Ends this process with the daemon, which made the socket. A daemon that is dead already sends no
// signal, but this process would have another parent by then.
void die_with_daemon(int socket) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ucred maker = {};
  socklen_t size = sizeof(maker);
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &maker, &size) != 0 ||
      maker.pid != ::getppid()) {
    std::_Exit(EXIT_FAILURE);
  }
}

void become_copy(Descriptor socket, const std::function<void()>& work) {
  die_with_daemon(socket.number());
  be_nicer(kImportNiceness);
  if (::dup2(socket.number(), kChildDescriptor) != kChildDescriptor) std::_Exit(EXIT_FAILURE);
  if (socket.number() != kChildDescriptor) socket = Descriptor();
  work();
  // The destructors of statics and the leak sanitizer would need calls that are forbidden by now.
  std::_Exit(EXIT_SUCCESS);
}

}  // namespace

void serve_copies(const std::function<void()>& work) {
  show_name();
  die_with_daemon(kChildDescriptor);
  for (;;) {
    Descriptor socket = receive_descriptor();
    if (socket.number() < 0) std::_Exit(EXIT_SUCCESS);
    const pid_t pid = fork_sibling();
    if (pid == 0) become_copy(std::move(socket), work);
    if (!respond(pid > 0 ? pid : -errno)) std::_Exit(EXIT_FAILURE);
  }
}

Child copy_of(const Child& server, const std::stop_token& stop) {
  SocketPair sockets = make_socket_pair();
  if (send_with(server.socket().number(), "?", sockets.theirs.number()) != 1) {
    throw_system_error("sendmsg", errno);
  }
  sockets.theirs = Descriptor();
  const auto deadline = Clock::now() + kLongestResponse;
  while (Clock::now() < deadline) {
    if (stop.stop_requested()) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    pollfd waiting = {server.socket().number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(kLook.count())) <= 0) continue;
    std::int32_t number = 0;
    const ssize_t count = ::recv(server.socket().number(), &number, sizeof(number), MSG_WAITALL);
    if (count < 0 && errno == EINTR) continue;
    if (count != sizeof(number)) break;
    if (number < 0) throw_system_error("fork", -number);
    return {number, std::move(sockets.ours)};
  }
  throw Error(ErrorCode::kInternal, "A program that prepares processes does not respond.");
}

}  // namespace isomesh::process
