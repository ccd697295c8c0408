#include "base/descriptor.h"

#include <cerrno>
#include <tuple>

#include <fcntl.h>
#include <unistd.h>

#include "base/error.h"

namespace isomesh {

Descriptor::~Descriptor() {
  if (number_ >= 0) ::close(number_);
}

void write_all(const Descriptor& file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file.number(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_system_error("writing a file", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

void hold_standard_descriptors() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    // open() returns the lowest number that is free: all lower ones are held by now.
    if (::fcntl(number, F_GETFD) < 0) {
      std::ignore = ::open("/dev/null", number == STDOUT_FILENO ? O_RDONLY : O_WRONLY);
    }
  }
}

}  // namespace isomesh
