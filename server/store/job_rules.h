// Rules for jobs that are the same in all engines. For engines only.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// Retry-After of rejected submissions.
inline constexpr std::chrono::seconds kRetryAfter{1};
// Minimum interval between progress events of a run.
inline constexpr std::chrono::milliseconds kBetweenProgressEvents{100};

// Equal for all jobs whose results have the same bytes and properties. `notes` are the volume's; a
// mesh carries some of them.
std::string result_key(const std::string& volume, const std::vector<Note>& notes,
                       const JobParameters& parameters, const std::string& mesher_version);

// Cost of a job's turn in the queue, in microseconds: its expected run time, between 1 ms and a
// day, so that no job is free.
std::int64_t turn_cost_us(double expected_ms);

// The columns of a job, which can be read without its record.
struct JobColumns {
  std::string id;
  JobState state = JobState::kQueued;
  std::string volume = {};
  Priority priority = Priority::kRoutine;
  std::int64_t accepted_us = 0;
};

// The job in a record. Empty if the record is damaged, which is logged: it must not hide or block
// other jobs. The volume of the job's columns is compared, too, if the caller knows it. A record of
// a newer version is not damaged if this version cannot read it, so that is not logged.
std::optional<Job> readable_job(const std::string& record, const std::string& id,
                                const std::string& volume = {}, bool is_newer = false);

// The record of a newer version with the end of the job, without losing what only that version
// knows.
std::string with_end_of(const Job& job, const std::string& record);

// Stands for a job with a damaged record. Its parameters are lost, so it can only fail, with the
// error that this sets.
Job damaged_job(const JobColumns& columns);

// Throws Error kInternal.
[[noreturn]] void throw_damaged_job();
// Throws Error kUnavailable: another daemon can respond.
[[noreturn]] void throw_newer_job();

// Throws Error kNotFound, or kGone if the job's volume has expired.
[[noreturn]] void throw_no_volume(bool is_gone);
// Throws Error kNotFound, or kGone if the job has expired.
[[noreturn]] void throw_no_job(bool is_gone);

// Number of queued jobs, of all owners and of one.
struct QueueShare {
  std::size_t queued = 0;
  std::size_t own = 0;
};

// True if the queue has room for another job of the owner: the owner's share of it (base/share.h).
// Urgent jobs share an eighth of the queue, because all others wait for them. For an urgent job
// `waiting` counts urgent jobs only.
bool has_share_of_queue(const JobSpec& spec, const QueueShare& waiting, std::size_t max_queued);

// Delay before the next attempt of a job that has failed that often.
std::chrono::milliseconds delay_after(int attempts, const JobStoreOptions& options);

// Copies the times or the progress of a run into the job; keeps its time in the queue.
void give_timing(Job& job, const Timing& timing);
void give_progress(Job& job, const Progress& progress);

// Sets the job's mesh and the addresses of its files.
void give_mesh(Job& job, const MeshSummary& mesh);

// The blobs of the mesh: its files and the file of its labels.
std::vector<Blob> blobs_of(const MeshSummary& mesh);

bool have_same_blobs(const MeshSummary& one, const MeshSummary& other);

// is_there: every blob of the mesh exists with its size. is_intact: their bytes are also correct,
// which requires reading them.
bool is_there(const MeshSummary& mesh, const BlobStore& blobs);
bool is_intact(const MeshSummary& mesh, const BlobStore& blobs);

// Thrown by remake() if this version would make a different mesh.
[[noreturn]] void throw_other_version();
[[noreturn]] void throw_volume_gone();

// True if the viewer may see the event and it is of that job (empty: any).
bool concerns(const Event& event, const Viewer& viewer, const std::string& job);

}  // namespace isomesh::store
