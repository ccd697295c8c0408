#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::bench {

// An isomeshd of the benchmark's own on a free port of loopback, with a data folder of its own;
// killed when it goes.
class Daemon {
 public:
  // Throws std::runtime_error when it does not listen.
  Daemon(const std::filesystem::path& program, const std::vector<std::string>& arguments)
      : process_(test::with({program.string(), "--listen", "127.0.0.1:0", "--data",
                             folder_ / "data", "--log-level", "warn"},
                            arguments)),
        url_(test::url_of(process_)) {}

  const std::string& url() const { return url_; }

 private:
  test::TemporaryFolder folder_;
  test::Process process_;
  std::string url_;
};

}  // namespace isomesh::bench
