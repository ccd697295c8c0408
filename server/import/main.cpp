// isomesh-import: reads uploads for the daemon, each in a copy of itself that is forked in advance.
// A copy drops the rights that no import needs, reads its order from kChildDescriptor, drops those
// that the order does not need, and writes its response to the same descriptor.
#include <array>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <string>
#include <string_view>
#include <typeinfo>
#include <variant>

#include <unistd.h>

#include "base/error.h"
#include "proto/error.h"
#include "server/import/archives/archive.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/import.h"
#include "server/import/message/import_message.h"
#include "server/import/peers/response.h"
#include "server/process/child.h"
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
    if (count < 0) throw_system_error("read", errno);
    if (count == 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
}

Confinement confinement_of(const ResponseOrder& order) {
  return {.readable = order.task.source,
          .writable = {},
          .memory_bytes = order.bounds.memory_bytes,
          .file_bytes = 0,
          .time = order.bounds.time};
}

Confinement confinement_of(const ImportOrder& order) {
  // For headers, and for other members of an archive.
  constexpr std::uint64_t kHeadroom = std::uint64_t{64} << 20;
  return {.readable = order.task.source,
          .writable = order.task.scratch,
          .memory_bytes = order.bounds.memory_bytes,
          .file_bytes = order.task.limits.max_sample_bytes + kHeadroom,
          .time = order.bounds.time};
}

std::string read(const ImportOrder& order) {
  return volume_message(import::import_volume(
      order.task, [](std::string_view format) { respond(reading_message(format)); }));
}

std::string read(const ResponseOrder& order) {
  return response_message(import::read_response(order.task.source));
}

// Every exception becomes a message, the only output of this process.
std::string read_as_ordered(const std::string& message) {
  std::uint64_t memory_bytes = 0;
  try {
    const auto any_order = order_from(message);
    return std::visit(
        [&](const auto& order) {
          memory_bytes = order.bounds.memory_bytes;
          confine_to(confinement_of(order));
          respond(begun_message());
          return read(order);
        },
        any_order);
  } catch (const Error& error) {
    return error_message(error);
  } catch (const std::bad_alloc&) {
    return error_message({ErrorCode::kUnusableVolume,
                          "Reading the file needs more memory than the " +
                              std::to_string(memory_bytes) + " bytes that an import may use."});
  } catch (const std::exception& error) {
    // The text comes from a library and may quote the file, so it must not reach a log.
    return error_message(
        {ErrorCode::kInternal,
         std::string("An import failed with an exception: ") + typeid(error).name() + "."});
  }
}

void import_one() {
  confine_ahead();
  const std::string order = read_order();
  // The daemon does not need this process any more.
  if (order.empty()) return;
  respond(read_as_ordered(order));
}

}  // namespace

int main() {
  import::dicom::load_character_sets();
  import::load_name_encoding();
  serve_copies(import_one);
}
