#include "server/jobs/workers.h"

#include <chrono>
#include <exception>
#include <new>
#include <string>

#include <spdlog/spdlog.h>

namespace isomesh::jobs {
namespace {

// What a worker keeps between jobs: enough for a surface of some twenty million triangles.
constexpr std::size_t kWorkspaceBudgetBytes = std::size_t{1} << 30;

std::string mesh_path(const std::string& job, MeshFormat format) {
  return "/v1/jobs/" + job + "/mesh." + std::string(to_string(format));
}

Problem problem_of(const Error& error, const std::string& job) {
  return to_problem(error, "/v1/jobs/" + job);
}

}  // namespace

Workers::Workers(std::size_t threads, store::JobStore& jobs, const store::VolumeStore& volumes,
                 const store::BlobStore& blobs, const PipelineLimits& limits)
    : jobs_(jobs), volumes_(volumes), blobs_(blobs), limits_(limits), alive_(threads) {
  for (std::size_t i = 0; i < threads; ++i) {
    threads_.emplace_back([this] { work(claims_.get_token()); });
  }
}

Workers::~Workers() {
  claims_.request_stop();
  running_.request_stop();
}

bool Workers::drain(std::chrono::milliseconds wait) {
  claims_.request_stop();
  const auto deadline = std::chrono::steady_clock::now() + wait;
  constexpr auto kPoll = std::chrono::milliseconds(10);
  while (alive_ > 0 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kPoll);
  }
  return alive_ == 0;
}

void Workers::work(const std::stop_token& stop) {
  Workspace workspace;
  while (const auto lease = jobs_.claim(stop)) {
    run(*lease, workspace);
    workspace.trim(kWorkspaceBudgetBytes);
  }
  --alive_;
}

void Workers::run(const store::Lease& lease, Workspace& workspace) {
  // One token for both reasons to stop: the job is cancelled, or the service ends.
  std::stop_source stop;
  const std::stop_callback on_cancel(lease.cancelled, [&] { stop.request_stop(); });
  const std::stop_callback on_end(running_.get_token(), [&] { stop.request_stop(); });
  Timing timing;
  store::Outcome outcome;
  try {
    const Volume volume = volumes_.get(lease.parameters.volume);
    PipelineResult result =
        run_pipeline(volume, lease.parameters, limits_, blobs_, workspace, stop.get_token(),
                     [&](Stage stage, double progress, const Timing& so_far) {
                       jobs_.report(lease, stage, progress, so_far);
                     });
    for (auto& [format, file] : result.mesh.files) file.href = mesh_path(lease.id, format);
    outcome.mesh = std::move(result.mesh);
    timing = result.timing;
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kCancelled && !lease.cancelled.stop_requested()) {
      return jobs_.put_back(lease);
    }
    if (error.code() != ErrorCode::kCancelled) {
      spdlog::error("job {} failed: {}", lease.id, error.what());
      outcome.error = problem_of(error, lease.id);
    }
  } catch (const std::bad_alloc&) {
    spdlog::error("job {} failed: out of memory", lease.id);
    outcome.error = problem_of(
        Error(ErrorCode::kTooLarge, "there is not enough memory for this surface"), lease.id);
  } catch (const std::exception& error) {
    spdlog::error("job {} failed: {}", lease.id, error.what());
    outcome.error = problem_of(Error(ErrorCode::kInternal, error.what()), lease.id);
  }
  if (!jobs_.finish(lease, outcome, timing)) {
    spdlog::warn("job {} was ended by somebody else", lease.id);
  }
}

}  // namespace isomesh::jobs
