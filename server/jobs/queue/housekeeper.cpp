#include "server/jobs/queue/housekeeper.h"

#include <exception>

#include "base/log.h"
#include "base/mutex.h"

namespace isomesh::jobs {
namespace {

void enforce(store::Retention& retention) {
  try {
    const auto [jobs, volumes, blobs, quarantined, left] = retention.enforce();
    if (jobs + volumes + blobs > 0) {
      log_info("removed {} jobs, {} volumes and {} files", jobs, volumes, blobs);
    }
    if (quarantined > 0) {
      log_warning("{} files that no record names were put into quarantine", quarantined);
    }
    if (left > 0) {
      log_error(
          "{} more files that no record names were left in place: does this database belong to "
          "them?",
          left);
    }
  } catch (const std::exception& error) {
    log_error("expired data could not be removed and is retried: {}", error.what());
  }
}

}  // namespace

Housekeeper::Housekeeper(store::Retention& retention, VolumeLibrary& library,
                         std::chrono::milliseconds interval)
    : thread_([&retention, &library, interval](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          library.finish_erasing(stop);
          if (stop.stop_requested()) return;
          enforce(retention);
          pause(stop, interval);
        }
      }) {}

}  // namespace isomesh::jobs
