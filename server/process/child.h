// A process that this one has started and talks to over a socket.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include <sys/types.h>

#include "base/descriptor.h"

namespace isomesh::process {

// The descriptor of the socket in a child; it has no other but those of standard input and output,
// which lead nowhere.
inline constexpr int kChildDescriptor = 3;

// How often those who wait for a child look whether they are to stop.
inline constexpr std::chrono::milliseconds kLook{100};

// Two ends of a socket, which are closed when a program is started.
struct SocketPair {
  Descriptor ours;
  Descriptor theirs;
};

// Throws Error kInternal.
SocketPair make_socket_pair();

// What a child has said until it closed its end, or until no more was wanted of it.
struct Heard {
  enum class Ending { kClosed, kTooLong, kTooMuch, kStopped };

  Ending ending = Ending::kClosed;
  std::string text;
};

// A child of this process, which is killed and waited for at the end of the object's life. Not
// thread safe.
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

  // Sends all of that. A child that has ended is no error here: it is noticed when it is listened
  // to.
  void say(std::string_view message) const;

  // The same, and a descriptor with it, which stays the caller's. Throws Error kInternal or
  // kUnavailable when that cannot be passed.
  void say(std::string_view message, int passed) const;

  // As the first, and closes this direction.
  void tell(std::string_view message) const;

  // Everything that it says until it closes its end, at most `most_bytes` (about).
  Heard listen(std::size_t most_bytes, std::chrono::steady_clock::time_point deadline,
               const std::stop_token& stop) const;

  // Whether it has ended by itself.
  bool has_ended() { return reap(false); }

  // Its status as waitpid gives it, if it ends by itself within that time.
  std::optional<int> ended_within(std::chrono::milliseconds longest);

  // Kills it unless it has ended, and returns when it is gone.
  void end();

 private:
  bool reap(bool waiting);

  pid_t pid_;
  Descriptor socket_;
  int status_ = 0;
  bool reaped_ = false;
};

// "with signal 9 (killed)", "with status 1", "without a response": of a status as waitpid gives it,
// and of none. Ends a sentence.
std::string how_it_ended(const std::optional<int>& status);

// Starts a program that inherits nothing of this process but one end of a socket: its environment
// is empty, its signals have their defaults, and it leads a process group of its own. Safe with
// threads running. Throws Error kInternal.
Child start_program(const std::filesystem::path& program);

}  // namespace isomesh::process
