#include "client/cli/local_daemon.h"

#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

bool is_program(const fs::path& file) {
  std::error_code absent;
  return fs::is_regular_file(file, absent) && ::access(file.c_str(), X_OK) == 0;
}

fs::path find_program(const fs::path& given) {
  if (!given.empty()) {
    if (is_program(given)) return given;
    throw Error(ErrorCode::kInvalidParameter, "--daemon: " + given.string() + " is not a program");
  }
  std::error_code unknown;
  const fs::path own = fs::read_symlink("/proc/self/exe", unknown).parent_path();
  std::vector<fs::path> places = {own, own / "../sbin"};
  const char* path = std::getenv("PATH");
  for (const std::string_view folder : split(path == nullptr ? "" : path, ':')) {
    // An empty one would be the working folder, which may have strangers' files.
    if (!folder.empty()) places.emplace_back(folder);
  }
  for (const fs::path& place : places) {
    if (is_program(place / "isomeshd")) return (place / "isomeshd").lexically_normal();
  }
  throw Error(ErrorCode::kInvalidParameter,
              "the program isomeshd was not found; give its path by --daemon FILE");
}

// Omits variables that may configure another daemon.
std::vector<std::string> environment() {
  std::vector<std::string> all;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (!std::string_view(*entry).starts_with("ISOMESH")) all.emplace_back(*entry);
  }
  return all;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> result;
  for (std::string& text : texts) result.push_back(text.data());
  result.push_back(nullptr);
  return result;
}

// Returns the first line, or its beginning if the writer ends.
std::string first_line(int pipe) {
  std::string line;
  char letter = 0;
  while (::read(pipe, &letter, 1) == 1 && letter != '\n') line += letter;
  return line;
}

}  // namespace

LocalDaemon::LocalDaemon(const fs::path& program, int jobs) {
  try {
    start(find_program(program), jobs);
  } catch (...) {
    end();
    throw;
  }
}

LocalDaemon::~LocalDaemon() { end(); }

std::string LocalDaemon::url() const { return "unix:" + (folder_.path() / "socket").string(); }

void LocalDaemon::start(const fs::path& program, int jobs) {
  std::vector<std::string> words = {program.string(),
                                    "--listen",
                                    url(),
                                    "--data",
                                    folder_.path() / "data",
                                    "--workers",
                                    std::to_string(jobs),
                                    "--log-level",
                                    "error",
                                    "--drain-seconds",
                                    "0"};
  std::vector<std::string> variables = environment();
  const std::vector<char*> arguments = pointers(words);
  const std::vector<char*> setting = pointers(variables);
  std::array<int, 2> ends = {};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Error(ErrorCode::kInternal, std::string("a pipe: ") + std::strerror(errno));
  }
  const Descriptor output(ends[0]);
  Descriptor input(ends[1]);
  const std::string log = folder_.path() / "log";
  const Descriptor errors(::open(log.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  const pid_t parent = ::getpid();
  process_ = ::fork();
  if (process_ == 0) {
    // Only async-signal-safe calls after a fork. Ctrl-C is for the command, which ends the daemon.
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(1);
    ::dup2(input.number(), STDOUT_FILENO);
    ::dup2(errors.number(), STDERR_FILENO);
    // The daemon and its processes hold the folder for as long as they run.
    ::fcntl(folder_.lock().number(), F_SETFD, 0);
    ::execve(arguments[0], arguments.data(), setting.data());
    ::_exit(127);
  }
  if (process_ < 0) throw Error(ErrorCode::kInternal, "a process cannot be started");
  input = Descriptor(-1);
  if (!first_line(output.number()).starts_with("listening on ")) {
    const std::string text = read_whole(log);
    const std::string_view said = trimmed(text);
    throw Error(ErrorCode::kUnreachable, program.string() + " did not start" +
                                             (said.empty() ? "" : ": ") + std::string(said));
  }
}

void LocalDaemon::end() noexcept {
  if (process_ > 0) {
    ::kill(process_, SIGTERM);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  process_ = -1;
}

}  // namespace isomesh::cli
