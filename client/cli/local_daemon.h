// A daemon for one command; private to this folder.
#pragma once

#include <filesystem>
#include <string>

#include <sys/types.h>

namespace isomesh::cli {

// isomeshd on a socket that nobody else can reach, with a data folder that goes with it. It ends
// with this object, and with this process however that ends.
class LocalDaemon {
 public:
  // `program` is isomeshd; empty: beside this program, in ../sbin from there, or in PATH. So many
  // jobs run at the same time. Throws Error kInvalidParameter when there is no such program,
  // kUnreachable when it does not start, with what it said.
  LocalDaemon(const std::filesystem::path& program, int jobs);
  ~LocalDaemon();
  LocalDaemon(const LocalDaemon&) = delete;
  LocalDaemon& operator=(const LocalDaemon&) = delete;

  // As --server takes it.
  std::string url() const;

 private:
  void start(const std::filesystem::path& program, int jobs);
  void end() noexcept;

  std::filesystem::path folder_;
  pid_t process_ = -1;
};

}  // namespace isomesh::cli
