// A child process with a socket to it.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include <sys/types.h>

#include "base/descriptor.h"

namespace isomesh::process {

// The socket's descriptor in a child. Its only others are standard input, output and error, which
// are /dev/null.
inline constexpr int kChildDescriptor = 3;

// In a child: sends all of `bytes` to the daemon. Ends the process if the daemon has closed its
// end.
void respond(std::span<const std::byte> bytes);
inline void respond(std::string_view text) { respond(std::as_bytes(std::span(text))); }

// Interval at which a thread that waits for a child checks for a stop request.
inline constexpr std::chrono::milliseconds kLook{100};

// Two connected sockets, closed when a program is started.
struct SocketPair {
  Descriptor ours;
  Descriptor theirs;
};

// Throws Error kInternal.
SocketPair make_socket_pair();

// The bytes a child sent until it closed its end, or until reading ended.
struct Output {
  enum class Ending { kClosed, kTooLong, kTooMuch, kStopped };

  Ending ending = Ending::kClosed;
  std::string text;
};

// A child process; the destructor kills it and waits for it. Not thread safe.
class Child {
 public:
  Child(pid_t pid, Descriptor socket) : pid_(pid), socket_(std::move(socket)) {}
  ~Child() { end(); }
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t pid() const { return pid_; }
  const Descriptor& socket() const { return socket_; }

  // Sends the whole message. A child that has ended is not an error here; receive() notices it.
  void send(std::string_view message) const;

  // The same with a descriptor, which the caller keeps. Throws Error kInternal or kUnavailable if
  // it cannot be passed.
  void send(std::string_view message, int passed) const;

  // As the first, and closes this direction.
  void send_last(std::string_view message) const;

  // Reads until the child closes its end, at most about `most_bytes`.
  Output receive(std::size_t most_bytes, std::chrono::steady_clock::time_point deadline,
                 const std::stop_token& stop) const;

  // True if it has ended on its own.
  bool has_ended() { return reap(false); }

  // Its waitpid status, if it ends on its own within that time.
  std::optional<int> ended_within(std::chrono::milliseconds longest);

  // Kills it if it still runs, and waits for its end.
  void end();

 private:
  bool reap(bool waiting);

  pid_t pid_;
  Descriptor socket_;
  int status_ = 0;
  bool reaped_ = false;
};

// True if a waitpid status says that the process had no processor time left (Confinement::time).
bool is_out_of_time(const std::optional<int>& status);

// "with signal 9 (killed)", "with status 1", "without a response", "because it took too much
// processor time": from a waitpid status, or none. Ends a sentence.
std::string how_it_ended(const std::optional<int>& status);

// A program: its file, and the name of its processes.
struct Program {
  Program(std::filesystem::path path = {})  // NOLINT(google-explicit-constructor)
      : file(std::move(path)), name(file.filename()) {}
  Program(const char* path)  // NOLINT(google-explicit-constructor)
      : Program(std::filesystem::path(path)) {}

  std::filesystem::path file;
  std::string name;
  std::shared_ptr<const Descriptor> held = {};  // the opened file, if `file` is a link to it
};

// The program that is in the file now, also after an upgrade of the package has replaced the file:
// this process understands no other one. The program calls show_name(). Throws Error kInternal.
Program hold_program(const std::filesystem::path& path);

// Called by a program first: gives its process the program's name. The name of a program that is
// held would be the number of a descriptor.
void show_name();

// Starts a program that inherits only one end of a socket: its environment is empty, its signal
// handlers are the defaults, and it leads a process group of its own. Safe with threads running.
// Throws Error kInternal.
Child start_program(const Program& program);

}  // namespace isomesh::process
