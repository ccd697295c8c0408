// isomesh-dimse: speaks DIMSE with peers for the daemon. Each association runs in a process forked
// ahead of time. The process first drops the rights that no association needs, then receives its
// order with the peer's connection, drops all other rights, and reports the outcome.
#include <cstdint>
#include <string>
#include <variant>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "base/error.h"
#include "server/hospital/dimse/associations.h"
#include "server/hospital/dimse/daemon_channel.h"
#include "server/process/child.h"
#include "server/process/fork_server.h"
#include "server/process/sandbox.h"

namespace {

using namespace isomesh;
using namespace isomesh::process;
using namespace isomesh::dimse;

// Objects are streamed, so memory holds only the association and the head of one object.
constexpr std::uint64_t kMemoryBytes = std::uint64_t{512} << 20;
// Limit of processor time; enough for some hundred gigabytes.
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

DimseReport work_on(const DimseSending& order) { return dimse::send_object(order); }
DimseReport work_on(const DimseReceiving& order) { return dimse::receive_association(order); }

void serve_one() {
  confine_ahead_to_talk();
  const std::string line = dimse::read_order();
  if (line.empty()) return;
  const DimseOrder any_order = dimse_order_from(line);
  respond(to_line(std::visit(
      [](const auto& order) {
        confine_to(confinement_of(order));
        return work_on(order);
      },
      any_order)));
}

}  // namespace

int main() {
  // DCMTK's log messages name patients.
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  // Loaded now, because a confined process could not open the file.
  dcmDataDict.rdlock();
  dcmDataDict.rdunlock();
  serve_copies(serve_one);
}
