#include "server/volume/import_worker.h"

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <new>
#include <string>
#include <string_view>
#include <typeinfo>

#include <sys/prctl.h>
#include <unistd.h>

#include "proto/error.h"
#include "server/volume/canonical.h"
#include "server/volume/files.h"
#include "server/volume/import.h"
#include "server/volume/import_message.h"
#include "server/volume/sandbox.h"

namespace isomesh::volume {
namespace {

std::atomic<bool> program_has_worker = false;

std::string read_order() {
  std::string text;
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t count = ::read(kImportWorkerDescriptor, piece.data(), piece.size());
    if (count < 0) throw_system_error("read", errno);
    if (count == 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

void say(std::string_view message) {
  while (!message.empty()) {
    const ssize_t count = ::write(kImportWorkerDescriptor, message.data(), message.size());
    // Nobody listens any more: the daemon has given this import up.
    if (count < 0) std::_Exit(EXIT_FAILURE);
    message.remove_prefix(static_cast<std::size_t>(count));
  }
}

Confinement confinement_of(const ImportOrder& order) {
  // Headers, and what is unpacked from an archive beside the samples.
  constexpr std::uint64_t kHeadroom = std::uint64_t{64} << 20;
  return {.readable = order.task.source,
          .writable = order.task.scratch,
          .memory_bytes = order.bounds.memory_bytes,
          .file_bytes = order.task.limits.max_sample_bytes + kHeadroom,
          .time = order.bounds.time};
}

// The boundary of this process: what leaves it is a message.
std::string import_as_ordered() {
  ImportOrder order;
  try {
    order = order_from(read_order());
    confine(confinement_of(order));
    return volume_message(
        import_volume(order.task, [](std::string_view format) { say(reading_message(format)); }));
  } catch (const Error& error) {
    return error_message(error);
  } catch (const std::bad_alloc&) {
    return error_message(
        {ErrorCode::kUnusableVolume, "Reading it takes more memory than the " +
                                         std::to_string(order.bounds.memory_bytes) +
                                         " bytes that an import may have."});
  } catch (const std::exception& error) {
    // Its text is a library's, which may repeat what the file holds: not for a log.
    return error_message({ErrorCode::kInternal, std::string("An import ended with an exception: ") +
                                                    typeid(error).name() + "."});
  }
}

}  // namespace

void become_import_worker_if_asked(int argc, const char* const* argv) {
  program_has_worker = true;
  if (argc < 2 || std::string_view(argv[1]) != kImportWorkerArgument) return;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  say(import_as_ordered());
  // Without the destructors of statics, and without the leak sanitizer, which needs what is
  // forbidden by now.
  std::_Exit(EXIT_SUCCESS);
}

bool can_become_import_worker() { return program_has_worker; }

}  // namespace isomesh::volume
