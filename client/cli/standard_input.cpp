#include "client/cli/standard_input.h"

#include <array>
#include <cerrno>
#include <cstddef>
#include <functional>
#include <span>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"

namespace isomesh::cli {
namespace {

// Waits until standard input has bytes, or has ended. Throws Error kCancelled on a stop request.
class InputWait {
 public:
  explicit InputWait(const std::stop_token& stop)
      : stop_(stop), wake_(stop, [this] { ::eventfd_write(event_.number(), 1); }) {}

  void operator()() const {
    std::array<pollfd, 2> files = {{{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0},
                                    {.fd = event_.number(), .events = POLLIN, .revents = 0}}};
    while (::poll(files.data(), files.size(), -1) < 0 && errno == EINTR) {
    }
    if (stop_.stop_requested()) throw Error(ErrorCode::kCancelled, "interrupted");
  }

 private:
  const std::stop_token stop_;
  const Descriptor event_{::eventfd(0, EFD_CLOEXEC)};
  const std::stop_callback<std::function<void()>> wake_;
};

std::unique_ptr<InputCopy> copied(const std::stop_token& stop) {
  auto copy = std::make_unique<InputCopy>();
  const InputWait wait(stop);
  std::vector<std::byte> block(std::size_t{1} << 20);
  while (true) {
    wait();
    const ssize_t count = ::read(STDIN_FILENO, block.data(), block.size());
    if (count == 0) return copy;
    if (count > 0) {
      copy->file.write(std::span(block).first(static_cast<std::size_t>(count)));
    } else if (errno != EINTR && errno != EAGAIN) {
      throw Error(ErrorCode::kInvalidParameter, "standard input cannot be read");
    }
  }
}

}  // namespace

std::unique_ptr<InputCopy> standard_input_as_file(std::vector<std::filesystem::path>& files,
                                                  UploadOptions& how, const std::stop_token& stop) {
  for (std::filesystem::path& file : files) {
    if (file != "-") continue;
    auto copy = copied(stop);
    file = copy->file.path();
    if (how.name.empty()) how.name = "stdin";
    return copy;
  }
  return nullptr;
}

}  // namespace isomesh::cli
