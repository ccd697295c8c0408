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

// Equal for all jobs whose results have the same bytes and properties. A mesh depends on the
// samples of its volume, on some of the notes, and on its usual iso-value.
std::string result_key(const Volume& volume, const JobParameters& parameters,
                       const std::string& mesher_version);

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
// knows. That of `job` alone if the record is damaged.
std::string with_end_of(const Job& job, const std::string& record);

// Stands for a job with a damaged record. Its parameters are lost, so it can only fail, with the
// error that this sets.
Job damaged_job(const JobColumns& columns);

// Throws Error kInternal.
[[noreturn]] void throw_damaged_job();

// Delay before the next attempt of a job that has failed that often.
std::chrono::milliseconds delay_after(int attempts, const JobStoreOptions& options);

// Milliseconds between two times of the tables; always positive.
double milliseconds_between(std::int64_t begin_us, std::int64_t end_us);

// What the verbs of the queue do to a job's record. Times are those of the tables; `accepted_us` is
// that of the submission.
//
// A claim at `now_us`.
void start_run(Job& job, std::int64_t accepted_us, std::int64_t now_us);
// The state after a run with that outcome, unless the job was cancelled: kQueued if it runs again.
JobState state_after(const Outcome& outcome, int attempt, const JobStoreOptions& options);
// An end at `now_us`.
void end_job(Job& job, JobState state, std::int64_t accepted_us, std::int64_t now_us);
// An end with the mesh of an equal job that ran instead; call end_job() then.
void skip_run(Job& job, std::int64_t accepted_us, std::int64_t now_us);

// Copies the times or the progress of a run into the job; keeps its time in the queue.
void give_timing(Job& job, const Timing& timing);
void give_progress(Job& job, const Progress& progress);

// Sets the job's mesh and the addresses of its files.
void give_mesh(Job& job, const MeshSummary& mesh);

// The blobs of the mesh: its files and the file of its labels.
std::vector<Blob> blobs_of(const MeshSummary& mesh);

// True if every blob of the mesh exists with its size and its bytes, which are read for that.
bool is_intact(const MeshSummary& mesh, const BlobStore& blobs);

}  // namespace isomesh::store
