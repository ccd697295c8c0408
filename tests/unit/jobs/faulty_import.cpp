// Stands in for the daemon's own program where an import goes wrong: does what the uploaded file
// says.
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/import/message/import_message.h"
#include "server/process/fork_server.h"
#include "server/process/sandbox.h"
#include "server/volume/canonical.h"

namespace {

using namespace isomesh;
using namespace isomesh::import;
using namespace isomesh::process;

std::string read_order() {
  std::string text;
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t count = ::read(kChildDescriptor, piece.data(), piece.size());
    if (count <= 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

void say(std::string_view message) {
  if (::write(kChildDescriptor, message.data(), message.size()) < 0) std::_Exit(9);
}

void confine_as(const ImportOrder& order) {
  confine_to({.readable = order.task.source,
              .writable = order.task.scratch,
              .memory_bytes = order.bounds.memory_bytes,
              .file_bytes = std::uint64_t{1} << 20,
              .time = order.bounds.time});
}

// pause() is not among the calls that are left.
void hang() {
  for (;;) ::sleep(3600);
}

void eat_memory() {
  std::vector<std::string> eaten;
  for (;;) eaten.emplace_back(std::size_t{1} << 20, 'x');
}

// Tries what a confined process must not be able to do, and returns the names of what succeeded.
std::string escapes(const ImportOrder& order) {
  std::string found;
  const auto note = [&](bool done, const std::string& what) {
    if (done) found += what + " ";
  };
  const std::string outside = order.task.scratch.parent_path() / "outside";
  note(::open("/etc/passwd", O_RDONLY) >= 0, "reads-other-file");
  note(::open(order.task.source.c_str(), O_WRONLY) >= 0, "writes-upload");
  note(::open(outside.c_str(), O_WRONLY | O_CREAT, 0600) >= 0, "creates-outside");
  note(::socket(AF_INET, SOCK_STREAM, 0) >= 0, "internet-socket");
  note(::socket(AF_UNIX, SOCK_STREAM, 0) >= 0, "local-socket");
  note(::fork() >= 0, "forks");
  note(::kill(::getppid(), 0) == 0, "signals-the-daemon");
  const std::array<char*, 1> none = {nullptr};
  note(::execve("/bin/true", none.data(), none.data()) >= 0, "starts-programs");
  note(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1,
              0) != MAP_FAILED,
       "makes-code");
  note(::symlink("/etc/passwd", (order.task.scratch / "link").c_str()) == 0, "makes-links");
  note(::open(order.task.source.c_str(), O_RDONLY) < 0, "cannot-read-upload");
  note(::open((order.task.scratch / "new").c_str(), O_WRONLY | O_CREAT, 0600) < 0,
       "cannot-write-scratch");
  int inherited = 0;
  for (int descriptor = kChildDescriptor + 1; descriptor < 256; ++descriptor) {
    // Those that this function has opened itself are the two just above.
    if (::fcntl(descriptor, F_GETFD) >= 0) ++inherited;
  }
  note(inherited > 2, "inherits-descriptors");
  note(::getenv("PATH") != nullptr || ::getenv("HOME") != nullptr, "inherits-environment");
  return found;
}

Volume small_volume() {
  Volume volume;
  volume.format = "nifti";
  volume.dims = {2, 2, 2};
  volume.bytes = 8;
  return volume;
}

void lie_about_labels(const ImportOrder& order) {
  Volume volume = small_volume();
  volume.labels = {{.label = 2, .name = "liver"}, {.label = 1, .name = "kidney"}};
  const volume::CanonicalWriter writer(order.task.target,
                                       {volume.dims, volume.type, volume.geometry});
  say(volume_message(volume));
}

void misbehave(const std::string& what, const ImportOrder& order) {
  if (what == "crash") {
    std::signal(SIGSEGV, SIG_DFL);  // a sanitizer would make a status of it
    std::raise(SIGSEGV);
  }
  if (what == "exit") std::_Exit(7);
  if (what == "run out of time") std::raise(SIGXCPU);  // what the kernel sends at the limit
  if (what == "hang") hang();
  if (what == "close and hang") {
    ::close(kChildDescriptor);
    hang();
  }
  if (what == "chatter") {
    std::string crowd;
    for (int n = 0; n < 4096; ++n) crowd += reading_message("nifti");
    for (;;) say(crowd);
  }
  if (what == "babble") say("{\"reading\": 7}\n");
  if (what == "forge") say("{\"reading\": \"nifti\\u000a[error] forged\"}\n");
  if (what == "lie") say(volume_message(small_volume()));
  if (what == "lie about labels") lie_about_labels(order);
  confine_as(order);
  if (what == "memory") eat_memory();
  if (what == "escape")
    say(error_message({ErrorCode::kUnusableVolume, "[" + escapes(order) + "]"}));
}

void do_one() {
  confine_ahead();
  const std::string message = read_order();
  if (message.empty()) return;
  const auto any_order = order_from(message);
  const auto* const response = std::get_if<ResponseOrder>(&any_order);
  const ImportOrder order = response == nullptr
                                ? std::get<ImportOrder>(any_order)
                                : ImportOrder{{response->task.source, {}, {}}, response->bounds};
  say(begun_message());
  std::ifstream file(order.task.source);
  const std::string what{std::istreambuf_iterator<char>(file), {}};
  file.close();
  say(reading_message("nifti"));
  misbehave(what, order);
}

}  // namespace

int main() { serve_copies(do_one); }
