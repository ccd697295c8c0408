#include "tests/bench/daemon.h"

#include <stdexcept>
#include <string_view>

namespace isomesh::bench {
namespace {

std::vector<std::string> command(const std::filesystem::path& program,
                                 const std::filesystem::path& data,
                                 const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {program.string(), "--listen",    "127.0.0.1:0", "--data",
                                    data.string(),    "--log-level", "warn"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return words;
}

}  // namespace

Daemon::Daemon(const std::filesystem::path& program, const std::vector<std::string>& arguments)
    : process_(command(program, folder_ / "data", arguments)) {
  constexpr std::string_view kBegin = "listening on ";
  const std::string line = process_.first_line();
  if (!line.starts_with(kBegin)) {
    throw std::runtime_error("the daemon does not listen: " + process_.errors());
  }
  url_ = line.substr(kBegin.size());
}

}  // namespace isomesh::bench
