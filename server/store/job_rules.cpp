#include "server/store/job_rules.h"

#include <algorithm>

#include "base/clock.h"
#include "base/sha256.h"
#include "base/text.h"
#include "proto/error.h"
#include "proto/json.h"
#include "proto/json_values.h"
#include "server/store/damaged_records.h"
#include "server/store/microseconds.h"

namespace isomesh::store {
namespace {

constexpr const char* kDamagedJob =
    "the record of this job is damaged: delete the job, and submit it again";

}  // namespace

const Job& job_of(const Submission& submission) {
  if (submission.kind == Submission::Kind::kOwnersShare) {
    throw Error(ErrorCode::kTooManyRequests, "too many of your jobs are already waiting");
  }
  if (submission.kind == Submission::Kind::kConflict) {
    throw Error(ErrorCode::kKeyReused, "the idempotency key was used for another request");
  }
  if (submission.kind == Submission::Kind::kBusy) {
    throw Error(ErrorCode::kUnavailable, "the queue is full or the service is shutting down");
  }
  return submission.job;
}

std::string result_key(const Volume& volume, const JobParameters& parameters,
                       const std::string& mesher_version) {
  std::string text = mesher_version + '\n' + volume.samples + '\n' +
                     to_json(static_cast<const MeshParameters&>(parameters));
  if (!parameters.iso && !parameters.labels) text += "\niso " + to_text(volume.suggested_iso);
  for (const LabelEntry& entry : volume.labels) {
    if (!parameters.labels || entry.values.empty()) continue;
    text += "\nlabel " + std::to_string(entry.label) + " is";
    for (const std::int64_t value : entry.values) text += ' ' + std::to_string(value);
  }
  if (parameters.certify) text += "\ncertified";
  if (parameters.min_thickness_mm) text += "\nthickness " + to_text(*parameters.min_thickness_mm);
  for (const Note& note : notes_in_mesh(volume.notes))
    text += '\n' + note.code + ": " + note.detail;
  return sha256_of(text);
}

std::optional<Job> readable_job(const std::string& record, const std::string& id,
                                const std::string& volume, bool is_newer) {
  try {
    Job job = job_from_record(record);
    if (job.id == id && (volume.empty() || job.parameters.volume == volume)) return job;
  } catch (const Error&) {
    // Logged below, as a record of another job is.
  }
  if (!is_newer) report_damaged("job", id);
  return std::nullopt;
}

std::string with_end_of(const Job& job, const std::string& record) {
  try {
    JsonTree tree(without_digest(record));
    json_values::write_field(tree.root(), "state", job.state);
    json_values::write_field(tree.root(), "finished", job.finished);
    return with_digest(dump(tree.root()));
  } catch (const Error&) {
    return to_record(job);  // that version could not read it either
  }
}

Job damaged_job(const JobColumns& columns) {
  Job job;
  job.id = columns.id;
  job.state = columns.state;
  job.parameters.volume = columns.volume;
  job.parameters.priority = columns.priority;
  job.created = timestamp_of(from_us(columns.accepted_us));
  job.error = to_problem(Error(ErrorCode::kInternal, kDamagedJob), "/v1/jobs/" + job.id);
  job.error->detail = kDamagedJob;  // about the job, not the service, so clients may see it
  return job;
}

void throw_damaged_job() { throw Error(ErrorCode::kInternal, kDamagedJob, {{"id", kDamagedJob}}); }

std::chrono::milliseconds delay_after(int attempts, const JobStoreOptions& options) {
  constexpr int kGrowth = 4;
  std::chrono::milliseconds delay = options.retry_delay;
  for (int n = 1; n < attempts; ++n) delay *= kGrowth;
  return delay;
}

double milliseconds_between(std::int64_t begin_us, std::int64_t end_us) {
  // As floating point, because the difference of times in damaged rows may not fit in 64 bits.
  return std::max(static_cast<double>(end_us) - static_cast<double>(begin_us), 1.0) / 1000;
}

void start_run(Job& job, std::int64_t accepted_us, std::int64_t now_us) {
  job.state = JobState::kRunning;
  job.stage = Stage::kLoad;
  job.waiting_for.reset();
  job.started = timestamp_of(from_us(now_us));
  job.timing.queue = milliseconds_between(accepted_us, now_us);
}

JobState state_after(const Outcome& outcome, int attempt, const JobStoreOptions& options) {
  if (outcome.mesh) return JobState::kSucceeded;
  if (!outcome.error) return JobState::kCancelled;
  return outcome.may_retry && attempt < options.attempts ? JobState::kQueued : JobState::kFailed;
}

void end_job(Job& job, JobState state, std::int64_t accepted_us, std::int64_t now_us) {
  job.state = state;
  job.waiting_for.reset();
  job.finished = timestamp_of(from_us(now_us));
  if (state == JobState::kCancelled) job.error.reset();
  job.timing.total = milliseconds_between(accepted_us, now_us);
}

void skip_run(Job& job, std::int64_t accepted_us, std::int64_t now_us) {
  job.reused = true;
  job.timing = {};
  job.timing.queue = milliseconds_between(accepted_us, now_us);
}

void give_timing(Job& job, const Timing& timing) {
  const double queue = job.timing.queue;
  job.timing = timing;
  job.timing.queue = queue;
}

void give_progress(Job& job, const Progress& progress) {
  job.stage = progress.stage;
  job.progress = progress.share;
  give_timing(job, progress.timing);
}

void give_mesh(Job& job, const MeshSummary& mesh) {
  job.mesh = mesh;
  job.stage = Stage::kDone;
  job.progress = 1;
  for (auto& [format, file] : job.mesh->files) file.href = mesh_path(job.id, format);
  for (LabelSummary& label : job.mesh->labels) {
    for (auto& [format, file] : label.files) file.href = mesh_path(job.id, format, label.label);
  }
}

std::vector<Blob> blobs_of(const MeshSummary& mesh) {
  std::vector<Blob> blobs;
  for (const auto& [format, file] : mesh.files) blobs.push_back({file.sha256, file.bytes});
  for (const auto& list : {mesh.label_list, mesh.wall_list}) {
    if (list) blobs.push_back({list->sha256, list->bytes});
  }
  return blobs;
}

bool is_intact(const MeshSummary& mesh, const BlobStore& blobs) {
  return std::ranges::all_of(blobs_of(mesh), [&](const Blob& blob) {
    return blobs.size(blob.key) == blob.bytes && is_there_and_intact(blobs, blob.key, {});
  });
}

}  // namespace isomesh::store
