// A daemon for one command; private to this folder.
#pragma once

#include <filesystem>
#include <string>

#include <sys/types.h>

#include "client/cli/run_folder.h"

namespace isomesh::cli {

// isomeshd on a private socket, with a temporary data folder. It ends with this object, and also
// with this process, however that ends.
class LocalDaemon {
 public:
  // `program` is isomeshd; if empty, it is searched for beside this program, in ../sbin from there
  // and in PATH. `jobs` run at the same time. Throws Error kInvalidParameter if there is no such
  // program, and kUnreachable with its own message if it does not start.
  LocalDaemon(const std::filesystem::path& program, int jobs);
  ~LocalDaemon();
  LocalDaemon(const LocalDaemon&) = delete;
  LocalDaemon& operator=(const LocalDaemon&) = delete;

  // The address in the form of --server.
  std::string url() const;

 private:
  void start(const std::filesystem::path& program, int jobs);
  void end() noexcept;

  RunFolder folder_;
  pid_t process_ = -1;
};

}  // namespace isomesh::cli
