// isomesh-dimse: a program that speaks DIMSE with peers for the daemon, each association in a copy
// of itself that is made ahead. A copy gives up what no association needs, reads its order, with
// which the connection to the peer comes, gives up the rest, and tells what came of it.
#include <cstdint>
#include <string>
#include <variant>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "base/error.h"
#include "server/hospital/association/receive.h"
#include "server/hospital/association/send.h"
#include "server/hospital/association/talk.h"
#include "server/process/fork_server.h"
#include "server/process/sandbox.h"

namespace {

using namespace isomesh;
using namespace isomesh::process;

// Objects go through in pieces; what stays in memory is an association and an object's head.
constexpr std::uint64_t kMemoryBytes = std::uint64_t{512} << 20;
// Of the processor: for some hundred gigabytes.
constexpr std::chrono::hours kTime{1};

Confinement confinement_of(const DimseSending& order) {
  return {.readable = order.file,
          .writable = {},
          .memory_bytes = kMemoryBytes,
          .file_bytes = 0,
          .time = kTime};
}

Confinement confinement_of(const DimseReceiving& order) {
  return {.readable = {},
          .writable = order.folder,
          .memory_bytes = kMemoryBytes,
          .file_bytes = order.max_object_bytes,
          .time = kTime};
}

DimseReport work_on(const DimseSending& order) { return association::send_object(order); }
DimseReport work_on(const DimseReceiving& order) { return association::receive_association(order); }

void serve_one() {
  confine_ahead_to_talk();
  const std::string line = association::read_order();
  if (line.empty()) return;
  const DimseOrder any_order = dimse_order_from(line);
  association::say(to_line(std::visit(
      [](const auto& order) {
        confine_to(confinement_of(order));
        return work_on(order);
      },
      any_order)));
}

}  // namespace

int main() {
  // What DCMTK tells of names patients.
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  // Read now, because a confined copy could not.
  dcmDataDict.rdlock();
  dcmDataDict.rdunlock();
  serve_copies(serve_one);
}
