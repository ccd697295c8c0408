#include "tests/support/process.h"

#include <csignal>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <thread>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace isomesh::test {
namespace {

std::vector<std::string> environment_with(const std::vector<std::string>& added) {
  std::vector<std::string> variables = added;
  for (char** variable = ::environ; *variable != nullptr; ++variable) {
    if (!std::string_view(*variable).starts_with("ISOMESH_")) variables.emplace_back(*variable);
  }
  return variables;
}

std::vector<char*> pointers_to(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

class Streams {
 public:
  explicit Streams(const TemporaryFolder& folder) {
    posix_spawn_file_actions_init(&actions_);
    open(STDIN_FILENO, "/dev/null", O_RDONLY);
    open(STDOUT_FILENO, folder / "output", O_WRONLY | O_CREAT);
    open(STDERR_FILENO, folder / "errors", O_WRONLY | O_CREAT);
  }
  ~Streams() { posix_spawn_file_actions_destroy(&actions_); }
  Streams(const Streams&) = delete;
  Streams& operator=(const Streams&) = delete;

  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  void open(int stream, const std::filesystem::path& path, int flags) {
    posix_spawn_file_actions_addopen(&actions_, stream, path.c_str(), flags, 0600);
  }

  posix_spawn_file_actions_t actions_;
};

}  // namespace

Process::Process(const std::vector<std::string>& command,
                 const std::vector<std::string>& environment) {
  std::vector<std::string> words = command;
  std::vector<std::string> variables = environment_with(environment);
  const Streams streams(folder_);
  const int error = ::posix_spawnp(&pid_, words.front().c_str(), streams.get(), nullptr,
                                   pointers_to(words).data(), pointers_to(variables).data());
  if (error != 0) {
    throw std::runtime_error("cannot start " + words.front() + ": " + std::strerror(error));
  }
}

Process::~Process() {
  if (has_ended()) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

std::string Process::first_line() {
  std::string text;
  const bool came = eventually([&] {
    const bool ended = has_ended();  // checked first, otherwise a last line could be missed
    text = output();
    return ended || text.find('\n') != std::string::npos;
  });
  if (!came) throw std::runtime_error("the program wrote no line");
  return text.substr(0, text.find('\n'));
}

void Process::send_signal(int number) const { ::kill(pid_, number); }

int Process::wait() {
  if (!eventually([&] { return has_ended(); })) {
    throw std::runtime_error("the program did not end");
  }
  return *status_;
}

bool Process::ends_within(std::chrono::seconds longest) {
  return eventually([&] { return has_ended(); }, longest);
}

std::string Process::output() const { return read_file(folder_ / "output"); }
std::string Process::errors() const { return read_file(folder_ / "errors"); }

bool Process::has_ended() {
  if (status_) return true;
  int raw = 0;
  if (::waitpid(pid_, &raw, WNOHANG) != pid_) return false;
  constexpr int kOfSignals = 128;
  status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : kOfSignals + WTERMSIG(raw);
  return true;
}

std::string url_of(Process& daemon) {
  constexpr std::string_view kWords = "listening on ";
  const std::string line = daemon.first_line();
  if (!line.starts_with(kWords)) {
    throw std::runtime_error("the daemon does not listen: " + line + daemon.errors());
  }
  return line.substr(kWords.size());
}

std::vector<std::string> with(std::vector<std::string> words,
                              const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Finished run(const std::vector<std::string>& command, const std::vector<std::string>& environment) {
  Process process(command, environment);
  const int status = process.wait();
  return {status, process.output(), process.errors()};
}

namespace {

struct Status {
  std::string program;
  pid_t parent = 0;
};

// Empty if the process has ended, even if it was not waited for.
std::optional<Status> status_of(const std::string& process) {
  std::ifstream file("/proc/" + process + "/stat");
  std::string line;
  std::getline(file, line);
  const std::size_t begin = line.find('(');
  const std::size_t end = line.rfind(')');
  if (end == std::string::npos || line[end + 2] == 'Z') return std::nullopt;
  return Status{line.substr(begin + 1, end - begin - 1), std::stoi(line.substr(end + 4))};
}

}  // namespace

std::string program_of(pid_t process) {
  const auto status = status_of(std::to_string(process));
  return status ? status->program : "";
}

std::set<pid_t> children_of(pid_t parent) {
  std::set<pid_t> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const auto status = status_of(name);
    if (status && status->parent == parent) found.insert(std::stoi(name));
  }
  return found;
}

bool eventually(const std::function<bool()>& condition, std::chrono::seconds longest) {
  constexpr std::chrono::milliseconds kBetweenLooks{2};
  const auto deadline = std::chrono::steady_clock::now() + longest;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(kBetweenLooks);
  }
  return true;
}

}  // namespace isomesh::test
