#include "client/cli/uploads.h"

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
#include "client/cli/console.h"
#include "client/cli/text.h"
#include "client/isomesh/package.h"

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

std::string files_in_words(const std::vector<PackedFile>& files) {
  return grouped(files.size()) + (files.size() == 1 ? " file" : " files");
}

// The folder's content may differ from its name.
void tell_folders(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& path : files) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) continue;
    const std::vector<PackedFile> sent = files_of_upload(path);
    std::uint64_t bytes = 0;
    for (const PackedFile& file : sent) bytes += std::filesystem::file_size(file.path, error);
    complain("sending " + files_in_words(sent) + " of " + path.string() + ", " +
             human_bytes(bytes));
  }
}

}  // namespace

std::unique_ptr<InputCopy> standard_input_as_file(std::vector<std::filesystem::path>& files,
                                                  const std::stop_token& stop) {
  for (std::filesystem::path& file : files) {
    if (file != "-") continue;
    auto copy = copied(stop);
    file = copy->folder.path() / "stdin";
    std::filesystem::rename(copy->file.path(), file);
    return copy;
  }
  return nullptr;
}

std::vector<UploadedVolume> upload_all(Client& client, const Options& options,
                                       const std::vector<std::filesystem::path>& files,
                                       const UploadOptions& how, ProgressBar& bar,
                                       const std::string& subject) {
  if (!options.quiet) tell_folders(files);
  UploadOptions watched = how;
  watched.progress = [&](std::uint64_t done, std::uint64_t total) {
    bar.transfer(done < total ? "upload" : "check", done, total);
  };
  std::vector<UploadedVolume> volumes = client.upload_all(files, watched);
  bar.clear();
  for (const UploadedVolume& each : volumes) {
    if (!each.volume) continue;
    const bool has_both = !subject.empty() && volumes.size() > 1;
    tell_notes(each.volume->notes, options,
               subject + (has_both ? ": " : "") + (volumes.size() > 1 ? each.member : ""));
  }
  return volumes;
}

}  // namespace isomesh::cli
