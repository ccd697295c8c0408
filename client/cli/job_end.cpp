#include "client/cli/job_end.h"

#include "client/cli/console.h"
#include "client/cli/exit_status.h"
#include "proto/empty_surface.h"

namespace isomesh::cli {
namespace {

Error reason_of(const Job& job) {
  if (job.error) return to_error(*job.error);
  return {ErrorCode::kCancelled, "the job was cancelled"};
}

}  // namespace

int status_of(const Error& error) {
  return error.code() == ErrorCode::kUnreachable ? kServerUnreachable : kRefused;
}

bool has_mesh(const Job& job, const Options& options) {
  return job.state == JobState::kSucceeded && job.mesh && (!job.mesh->empty || options.allow_empty);
}

int status_of(const Job& job, const Options& options, const std::string& subject) {
  if (job.state == JobState::kFailed || job.state == JobState::kCancelled) {
    complain(reason_of(job), subject);
    return kRefused;
  }
  if (!job.mesh || !job.mesh->empty || options.allow_empty) return kDone;
  complain(empty_surface(*job.mesh, "--allow-empty accepts that"), subject);
  return kRefused;
}

Job wait(Client& client, const std::string& id, ProgressBar& bar) {
  const JobProgress draw = [&](const Job& job) { bar.job(job); };
  Job job = client.wait(id, bar.visible() ? draw : JobProgress{});
  bar.clear();
  return job;
}

Job with_labels(Client& client, Job job) {
  if (job.mesh && job.mesh->labels_count) job.mesh->labels = client.job_labels(job.id);
  return job;
}

LengthUnit unit_of(Client& client, const Job& job) {
  try {
    return length_unit(client.volume(job.parameters.volume).notes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return length_unit({});
  }
}

}  // namespace isomesh::cli
