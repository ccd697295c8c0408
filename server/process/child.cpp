#include "server/process/child.h"

#include <array>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "server/process/passing.h"

namespace isomesh::process {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

void require_spawn(int error, std::string_view call) {
  if (error != 0) throw_system_error(call, error);
}

// A started program inherits one socket, nothing else.
class Inheritance {
 public:
  explicit Inheritance(int socket) {
    require_spawn(::posix_spawn_file_actions_init(&files_), "posix_spawn_file_actions_init");
    require_spawn(::posix_spawnattr_init(&attributes_), "posix_spawnattr_init");
    // Duplicate the socket first, because the next actions may close its original number.
    add(::posix_spawn_file_actions_adddup2(&files_, socket, kChildDescriptor));
    for (int standard = 0; standard < kChildDescriptor; ++standard) {
      add(::posix_spawn_file_actions_addopen(&files_, standard, "/dev/null", O_RDWR, 0));
    }
    add(::posix_spawn_file_actions_addclosefrom_np(&files_, kChildDescriptor + 1));
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes_, &none);
    ::posix_spawnattr_setsigdefault(&attributes_, &all);
    // A process group of its own: Ctrl-C is sent to the terminal's whole group, but the daemon
    // decides how the process ends.
    ::posix_spawnattr_setpgroup(&attributes_, 0);
    ::posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~Inheritance() {
    ::posix_spawn_file_actions_destroy(&files_);
    ::posix_spawnattr_destroy(&attributes_);
  }
  Inheritance(const Inheritance&) = delete;
  Inheritance& operator=(const Inheritance&) = delete;

  pid_t start(const Program& program) const {
    std::string name = program.name;
    const std::array<char*, 2> arguments = {name.data(), nullptr};
    // All symbols are found before main(): each copy of the program would look up again whatever
    // it had not yet called.
    std::string bind_now = "LD_BIND_NOW=1";
    const std::array<char*, 2> environment = {bind_now.data(), nullptr};
    pid_t pid = -1;
    require_spawn(::posix_spawn(&pid, program.file.c_str(), &files_, &attributes_, arguments.data(),
                                environment.data()),
                  "posix_spawn");
    return pid;
  }

 private:
  static void add(int error) { require_spawn(error, "posix_spawn_file_actions_add"); }

  posix_spawn_file_actions_t files_;
  posix_spawnattr_t attributes_;
};

}  // namespace

void respond(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(kChildDescriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) std::_Exit(EXIT_FAILURE);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

SocketPair make_socket_pair() {
  std::array<int, 2> ends = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw_system_error("socketpair", errno);
  }
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

Child::Child(Child&& other) noexcept
    : pid_(other.pid_),
      socket_(std::move(other.socket_)),
      status_(other.status_),
      reaped_(std::exchange(other.reaped_, true)) {}

Child& Child::operator=(Child&& other) noexcept {
  std::swap(pid_, other.pid_);
  std::swap(socket_, other.socket_);
  std::swap(status_, other.status_);
  std::swap(reaped_, other.reaped_);
  return *this;
}

void Child::send(std::string_view message) const {
  while (!message.empty()) {
    const ssize_t count = ::send(socket_.number(), message.data(), message.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return;
    message.remove_prefix(static_cast<std::size_t>(count));
  }
}

void Child::send(std::string_view message, int passed) const {
  ssize_t count = 0;
  do {
    count = send_with(socket_.number(), message, passed);
  } while (count < 0 && errno == EINTR);
  if (count >= 0) return send(message.substr(static_cast<std::size_t>(count)));
  if (errno != EPIPE && errno != ECONNRESET) throw_system_error("sendmsg", errno);
}

void Child::send_last(std::string_view message) const {
  send(message);
  ::shutdown(socket_.number(), SHUT_WR);
}

Output Child::receive(std::size_t most_bytes, Clock::time_point deadline,
                      const std::stop_token& stop) const {
  Output output;
  std::array<char, 4096> piece;
  for (;;) {
    if (stop.stop_requested()) return {Output::Ending::kStopped, {}};
    if (Clock::now() >= deadline) return {Output::Ending::kTooLong, std::move(output.text)};
    if (output.text.size() > most_bytes) return {Output::Ending::kTooMuch, {}};
    pollfd waiting = {socket_.number(), POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(kLook.count())) <= 0) continue;
    const ssize_t count = ::read(socket_.number(), piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return output;
    output.text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

std::optional<int> Child::ended_within(milliseconds longest) {
  constexpr milliseconds kStep{2};
  for (const auto until = Clock::now() + longest;;) {
    if (reap(false)) return status_;
    if (Clock::now() >= until) return std::nullopt;
    std::this_thread::sleep_for(kStep);
  }
}

void Child::end() {
  if (reaped_) return;
  ::kill(pid_, SIGKILL);
  reap(true);
}

bool Child::reap(bool waiting) {
  if (reaped_) return true;
  pid_t found = 0;
  do {
    found = ::waitpid(pid_, &status_, waiting ? 0 : WNOHANG);
  } while (found < 0 && errno == EINTR);
  return reaped_ = found != 0;
}

bool is_out_of_time(const std::optional<int>& status) {
  return status && WIFSIGNALED(*status) && WTERMSIG(*status) == SIGXCPU;
}

std::string how_it_ended(const std::optional<int>& status) {
  if (!status) return "without a response";
  if (is_out_of_time(status)) return "because it took too much processor time";
  if (!WIFSIGNALED(*status)) return "with status " + std::to_string(WEXITSTATUS(*status));
  const char* const known = ::sigdescr_np(WTERMSIG(*status));
  std::string name = known == nullptr ? "unknown" : known;
  name[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
  return "with signal " + std::to_string(WTERMSIG(*status)) + " (" + name + ')';
}

Program hold_program(const std::filesystem::path& path) {
  Program program = path;
  program.held = std::make_shared<const Descriptor>(::open(path.c_str(), O_PATH | O_CLOEXEC));
  const int number = program.held->number();
  if (number < 0) throw_system_error("open", errno);
  // Not "self": a program inherits no such descriptor.
  program.file = "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(number);
  return program;
}

void show_name() { ::prctl(PR_SET_NAME, program_invocation_short_name); }

Child start_program(const Program& program) {
  SocketPair sockets = make_socket_pair();
  const pid_t pid = Inheritance(sockets.theirs.number()).start(program);
  return {pid, std::move(sockets.ours)};
}

}  // namespace isomesh::process
