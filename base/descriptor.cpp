#include "base/descriptor.h"

#include <cerrno>

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

}  // namespace isomesh
