// isomesh-import: a program that reads uploads for the daemon, each in a copy of itself that is
// made ahead. A copy gives up what no import needs, reads its order from kChildDescriptor, gives up
// what the order does not need, and writes its answer to the same descriptor.
#include <array>
#include <cstdlib>
#include <new>
#include <string>
#include <string_view>
#include <typeinfo>

#include <unistd.h>

#include "base/error.h"
#include "proto/error.h"
#include "server/import/import.h"
#include "server/process/fork_server.h"
#include "server/process/import_message.h"
#include "server/process/sandbox.h"
#include "server/volume/canonical.h"

namespace {

using namespace isomesh;
using namespace isomesh::process;

std::string read_order() {
  std::string text;
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t count = ::read(kChildDescriptor, piece.data(), piece.size());
    if (count < 0) throw_system_error("read", errno);
    if (count == 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

void say(std::string_view message) {
  while (!message.empty()) {
    const ssize_t count = ::write(kChildDescriptor, message.data(), message.size());
    // The daemon has closed its end, because it has given this import up.
    if (count < 0) std::_Exit(EXIT_FAILURE);
    message.remove_prefix(static_cast<std::size_t>(count));
  }
}

Confinement confinement_of(const ImportOrder& order) {
  // For headers, and for what an archive holds beside the samples.
  constexpr std::uint64_t kHeadroom = std::uint64_t{64} << 20;
  return {.readable = order.task.source,
          .writable = order.task.scratch,
          .memory_bytes = order.bounds.memory_bytes,
          .file_bytes = order.task.limits.max_sample_bytes + kHeadroom,
          .time = order.bounds.time};
}

// Every exception becomes a message here, because nothing else leaves this process.
std::string import_as_ordered(const std::string& message) {
  ImportOrder order;
  try {
    order = order_from(message);
    confine_to(confinement_of(order));
    say(begun_message());
    return volume_message(import::import_volume(
        order.task, [](std::string_view format) { say(reading_message(format)); }));
  } catch (const Error& error) {
    return error_message(error);
  } catch (const std::bad_alloc&) {
    return error_message(
        {ErrorCode::kUnusableVolume, "Reading it takes more memory than the " +
                                         std::to_string(order.bounds.memory_bytes) +
                                         " bytes that an import may have."});
  } catch (const std::exception& error) {
    // Its text comes from a library and may repeat what the file holds, so it must not reach a log.
    return error_message({ErrorCode::kInternal, std::string("An import ended with an exception: ") +
                                                    typeid(error).name() + "."});
  }
}

void import_one() {
  confine_ahead();
  const std::string order = read_order();
  // The daemon has no use for this process any more.
  if (order.empty()) return;
  say(import_as_ordered(order));
}

}  // namespace

int main() { serve_copies(import_one); }
