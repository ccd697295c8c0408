// Programs that tests start. Nothing of the caller's ISOMESH_... environment reaches them.
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

// Far beyond what anything takes, also under a sanitizer on a busy machine.
inline constexpr std::chrono::seconds kLongest{120};

class Process {
 public:
  // Starts the command; a first word without a slash is looked for in PATH. `environment` holds
  // NAME=VALUE. Throws std::runtime_error when it cannot be started.
  explicit Process(const std::vector<std::string>& command,
                   const std::vector<std::string>& environment = {});
  // Kills it when it still runs.
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // The first line of its standard output, as soon as there is one; what there is of it when it
  // ends before. Throws std::runtime_error after kLongest.
  std::string first_line();

  pid_t id() const { return pid_; }

  void send_signal(int number) const;
  pid_t pid() const { return pid_; }

  // Its exit status; 128 and the signal's number when a signal ended it. Throws std::runtime_error
  // after kLongest.
  int wait();

  // Whether it ends within that time.
  bool ends_within(std::chrono::seconds longest);

  std::string output() const;
  std::string errors() const;

 private:
  bool has_ended();

  TemporaryFolder folder_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

struct Finished {
  int status = -1;
  std::string output;
  std::string errors;
};

// Starts the command and waits for its end.
Finished run(const std::vector<std::string>& command,
             const std::vector<std::string>& environment = {});

// The processes whose parent is `parent` and that have not ended.
std::set<pid_t> children_of(pid_t parent);

// The name of a process's program, at most 15 letters of it; empty when the process has ended.
std::string program_of(pid_t process);

// Calls `condition` until it is true; false when it is not within that time.
bool eventually(const std::function<bool()>& condition, std::chrono::seconds longest = kLongest);

}  // namespace isomesh::test
