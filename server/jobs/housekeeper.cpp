#include "server/jobs/housekeeper.h"

#include <exception>

#include <spdlog/spdlog.h>

#include "base/mutex.h"

namespace isomesh::jobs {
namespace {

void enforce(store::Retention& retention) {
  try {
    const auto [jobs, volumes, blobs, quarantined, left] = retention.enforce();
    if (jobs + volumes + blobs > 0) {
      spdlog::info("removed {} jobs, {} volumes and {} files", jobs, volumes, blobs);
    }
    if (quarantined > 0) {
      spdlog::warn("{} files that no record names are in quarantine now", quarantined);
    }
    if (left > 0) {
      spdlog::error(
          "{} more files that no record names stay where they are: is this the "
          "database that belongs to them?",
          left);
    }
  } catch (const std::exception& error) {
    spdlog::error("what is too old could not be removed, and is tried again: {}", error.what());
  }
}

}  // namespace

Housekeeper::Housekeeper(store::Retention& retention, std::chrono::milliseconds interval)
    : thread_([&retention, interval](const std::stop_token& stop) {
        Mutex mutex;
        Condition never;
        while (!stop.stop_requested()) {
          enforce(retention);
          Lock lock(mutex);
          never.wait_for(lock, stop, interval, [] { return false; });
        }
      }) {}

}  // namespace isomesh::jobs
