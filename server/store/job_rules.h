// What is the same of jobs whatever engine keeps them. For engines only.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// What a refused submission is told to wait.
inline constexpr std::chrono::seconds kRetryAfter{1};
// Between two events of a run's progress.
inline constexpr std::chrono::milliseconds kBetweenProgressEvents{100};

// The same for all jobs that make the same bytes and say the same of them, whatever else they are.
// `notes` are the volume's: a mesh carries some of them.
std::string result_key(const std::string& volume, const std::vector<Note>& notes,
                       const JobParameters& parameters, const std::string& mesher_version);

// What a turn in the queue costs, in microseconds: how long the run is expected to take. Never
// nothing, so that no owner's jobs are free, and at most a day.
std::int64_t turn_cost_us(double expected_ms);

// The job's volume is not there, or not any more.
[[noreturn]] void throw_no_volume(bool is_gone);
// The job itself is not.
[[noreturn]] void throw_no_job(bool is_gone);

// What waits in the queue, of all and of one owner.
struct QueueShare {
  std::size_t queued = 0;
  std::size_t own = 0;
};

// Whether the queue has room for one more of that owner: a share of it (base/share.h), and for
// urgent ones a share of an eighth of it, since everybody else's wait for those. `waiting` counts
// urgent ones only where the job is one.
bool has_share_of_queue(const JobSpec& spec, const QueueShare& waiting, std::size_t max_queued);

// How long a job that has failed so often waits until it is run again.
std::chrono::milliseconds delay_after(int attempts, const JobStoreOptions& options);

// The job is so far.
void give_progress(Job& job, const Progress& progress);

// The job has that mesh.
void give_mesh(Job& job, const MeshSummary& mesh);

// The blobs that the mesh is in: its files, and the file of its labels.
std::vector<Blob> blobs_of(const MeshSummary& mesh);

// Whether two meshes are in the same blobs.
bool have_same_blobs(const MeshSummary& one, const MeshSummary& other);

// Whether every blob of the mesh is there with all its bytes; and whether these are the right ones,
// which reads them.
bool is_there(const MeshSummary& mesh, const BlobStore& blobs);
bool is_intact(const MeshSummary& mesh, const BlobStore& blobs);

// What remake() says when the mesh cannot be made again.
[[noreturn]] void throw_other_version();
[[noreturn]] void throw_volume_gone();

// Whether that viewer, asking for that job (empty: any), sees the event.
bool concerns(const Event& event, const Viewer& viewer, const std::string& job);

}  // namespace isomesh::store
