#include "server/jobs/housekeeper.h"

#include <condition_variable>
#include <exception>
#include <mutex>

#include <spdlog/spdlog.h>

namespace isomesh::jobs {
namespace {

void enforce(store::Retention& retention) {
  try {
    const auto [jobs, volumes, blobs] = retention.enforce();
    if (jobs + volumes + blobs > 0) {
      spdlog::info("let go of {} jobs, {} volumes and {} files", jobs, volumes, blobs);
    }
  } catch (const std::exception& error) {
    spdlog::error("what is too old could not be let go of, and is tried again: {}", error.what());
  }
}

}  // namespace

Housekeeper::Housekeeper(store::Retention& retention, std::chrono::milliseconds interval)
    : thread_([&retention, interval](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any never;
        while (!stop.stop_requested()) {
          enforce(retention);
          std::unique_lock lock(mutex);
          never.wait_for(lock, stop, interval, [] { return false; });
        }
      }) {}

}  // namespace isomesh::jobs
