#include "server/store/job_rules.h"

#include <algorithm>
#include <cmath>

#include "base/clock.h"
#include "base/sha256.h"
#include "base/share.h"
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

std::string result_key(const std::string& volume, const std::vector<Note>& notes,
                       const JobParameters& parameters, const std::string& mesher_version) {
  std::string text = mesher_version + '\n' + volume + '\n' +
                     to_json(static_cast<const MeshParameters&>(parameters));
  if (parameters.certify) text += "\ncertified";
  for (const Note& note : notes_in_mesh(notes)) text += '\n' + note.code + ": " + note.detail;
  return sha256_of(text);
}

std::int64_t turn_cost_us(double expected_ms) {
  constexpr double kLeast = 1;
  constexpr double kMost = 24.0 * 3600 * 1000;
  const double bounded = std::isnan(expected_ms) ? kMost : std::clamp(expected_ms, kLeast, kMost);
  return std::llround(bounded * 1000);
}

void throw_no_volume(bool is_gone) {
  const std::string detail =
      is_gone ? "the volume has expired: upload it again" : "there is no volume with this id";
  throw Error(is_gone ? ErrorCode::kGone : ErrorCode::kNotFound, detail, {{"volume", detail}});
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
  JsonTree tree(record);
  json_values::write_field(tree.root(), "state", job.state);
  json_values::write_field(tree.root(), "finished", job.finished);
  return dump(tree.root());
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

void throw_newer_job() {
  throw Error(ErrorCode::kUnavailable,
              "a newer version of the service accepted this job, and this daemon cannot read it: "
              "try again");
}

void throw_no_job(bool is_gone) {
  if (is_gone) throw Error(ErrorCode::kGone, "the job has expired");
  throw Error(ErrorCode::kNotFound, "there is no job with this id");
}

bool has_share_of_queue(const JobSpec& spec, const QueueShare& waiting, std::size_t max_queued) {
  constexpr std::size_t kStatShare = 8;
  const bool is_stat = spec.parameters.priority == Priority::kStat;
  const std::size_t room = is_stat ? std::max<std::size_t>(max_queued / kStatShare, 1) : max_queued;
  return has_share(spec.owner, waiting.own, room - std::min(room, waiting.queued));
}

std::chrono::milliseconds delay_after(int attempts, const JobStoreOptions& options) {
  constexpr int kGrowth = 4;
  std::chrono::milliseconds delay = options.retry_delay;
  for (int n = 1; n < attempts; ++n) delay *= kGrowth;
  return delay;
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
  if (mesh.label_list) blobs.push_back({mesh.label_list->sha256, mesh.label_list->bytes});
  return blobs;
}

bool have_same_blobs(const MeshSummary& one, const MeshSummary& other) {
  return std::ranges::equal(blobs_of(one), blobs_of(other), {}, &Blob::key, &Blob::key);
}

bool is_there(const MeshSummary& mesh, const BlobStore& blobs) {
  return std::ranges::all_of(blobs_of(mesh),
                             [&](const Blob& blob) { return blobs.size(blob.key) == blob.bytes; });
}

bool is_intact(const MeshSummary& mesh, const BlobStore& blobs) {
  return std::ranges::all_of(
      blobs_of(mesh), [&](const Blob& blob) { return is_there_and_intact(blobs, blob.key, {}); });
}

void throw_other_version() {
  throw Error(ErrorCode::kGone,
              "the stored mesh is damaged, and this version would make a different one: submit the "
              "job again");
}

void throw_volume_gone() {
  throw Error(
      ErrorCode::kGone,
      "the stored mesh is damaged, and its volume no longer exists: upload the volume again");
}

bool concerns(const Event& event, const Viewer& viewer, const std::string& job) {
  return (!viewer || *viewer == event.owner) && (job.empty() || job == event.job);
}

}  // namespace isomesh::store
