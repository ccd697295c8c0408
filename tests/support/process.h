// Runs programs for tests. They do not inherit ISOMESH_... variables.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <sys/types.h>

#include "tests/support/files.h"

namespace isomesh::test {

// Far above any real duration, also under a sanitizer on a busy machine.
inline constexpr std::chrono::seconds kLongest{300};

class Process {
 public:
  // Starts the command; a first word without a slash is searched for in PATH. `environment` holds
  // NAME=VALUE. Throws std::runtime_error if it cannot be started.
  explicit Process(const std::vector<std::string>& command,
                   const std::vector<std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Waits for the first line of its standard output; returns an incomplete one if it ends before.
  // Throws std::runtime_error after kLongest.
  std::string first_line();

  void send_signal(int number) const;
  pid_t pid() const { return pid_; }

  // Its exit status, or 128 plus the number of the signal that ended it. Throws std::runtime_error
  // after kLongest.
  int wait();

  bool ends_within(std::chrono::seconds longest);

  std::string output() const;
  std::string errors() const;

 private:
  bool has_ended();

  TemporaryFolder folder_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

// The address of an isomeshd, as its first line says: http://127.0.0.1:PORT or unix:PATH. Throws
// std::runtime_error if it does not listen.
std::string url_of(Process& daemon);

struct Finished {
  int status = -1;
  std::string output;
  std::string errors;

  // The first line of its output, without its end.
  std::string line() const { return output.substr(0, output.find('\n')); }
};

// The words of a command and more of them.
std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more);

Finished run(const std::vector<std::string>& command,
             const std::vector<std::string>& environment = {});

// The running processes whose parent is `parent`.
std::set<pid_t> children_of(pid_t parent);

// The name of a process's program, at most 15 letters; empty if it has ended.
std::string program_of(pid_t process);

// Calls `condition` until it is true; returns false if that takes too long.
bool eventually(const std::function<bool()>& condition, std::chrono::seconds longest = kLongest);

}  // namespace isomesh::test
