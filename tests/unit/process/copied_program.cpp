// A program that serves copies, which answer one question each.
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include <dirent.h>
#include <sys/auxv.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/hex.h"
#include "server/process/fork_server.h"

namespace {

using namespace isomesh::process;
using isomesh::to_hex;

int questions = 0;

int open_descriptors() {
  int count = 0;
  DIR* const folder = ::opendir("/proc/self/fd");
  while (const dirent* const entry = ::readdir(folder)) {
    const std::string name = entry->d_name;
    if (name.front() != '.' && std::stoi(name) != ::dirfd(folder)) ++count;
  }
  ::closedir(folder);
  return count;
}

// Random bytes that the kernel provides at program start (AT_RANDOM). Copies of the process have
// the same.
std::string random_of_this_program() {
  constexpr std::size_t kBytes = 16;
  return to_hex(std::span(reinterpret_cast<const std::uint8_t*>(::getauxval(AT_RANDOM)), kBytes));
}

void answer() {
  std::string question;
  std::array<char, 64> piece;
  for (;;) {
    const ssize_t count = ::read(kChildDescriptor, piece.data(), piece.size());
    if (count <= 0) break;
    question.append(piece.data(), static_cast<std::size_t>(count));
  }
  if (question.empty()) return;
  ++questions;
  if (question == "hang") {
    for (;;) ::pause();
  }
  const std::string text = question == "which" ? random_of_this_program()
                           : question == "niceness"
                               ? std::to_string(::getpriority(PRIO_PROCESS, 0))
                               : "questions " + std::to_string(questions) + ", descriptors " +
                                     std::to_string(open_descriptors());
  if (::write(kChildDescriptor, text.data(), text.size()) < 0) ::_exit(1);
}

}  // namespace

int main() { serve_copies(answer); }
