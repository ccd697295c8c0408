// What the parts of PostgresJobStore share. Private to this folder.
#pragma once

#include <string>
#include <vector>

#include "server/store/postgresql/job_store.h"

namespace isomesh::store::postgresql {

struct PostgresJobStore::Row {
  Job job;
  std::string owner;
  std::string result_key;
  std::int64_t accepted = 0;
  int attempts = 0;
  std::uint64_t fence = 0;
};

// How a run is to end.
struct PostgresJobStore::Ending {
  bool ends_others = false;  // it is not this process's own, and its lease is over
  JobState state = JobState::kQueued;
  std::string record = {};     // of those that do not run again
  std::string cancelled = {};  // the record, should it have been asked to stop
  const MeshSummary* mesh = nullptr;
  std::chrono::milliseconds delay{0};  // of those that do, until they may
  std::optional<WaitingFor> waiting_for = {};
  bool counts = false;  // as an attempt
};

// The columns that row_of() reads, and where they are from.
inline constexpr const char* kRow =
    "SELECT j.record, j.owner, j.result_key, j.accepted, j.attempts, j.fence, j.state, "
    "j.waiting_for, r.claimed, r.stage, r.progress, r.timing FROM jobs j LEFT JOIN runs r ON r.job "
    "= j.id ";

inline std::int64_t microseconds(std::chrono::milliseconds time) {
  return std::chrono::microseconds(time).count();
}

// The time between two that the database keeps, in milliseconds; never nothing.
double milliseconds_between(std::int64_t begin_us, std::int64_t end_us);

// What is told of a mesh's blobs.
struct NamedBlobs {
  std::vector<std::string> keys;
  std::vector<std::int64_t> bytes;
};
NamedBlobs blobs_of(const MeshSummary* mesh);

// How a time of the tables is told.
std::string timestamp_of_us(std::int64_t us);

}  // namespace isomesh::store::postgresql
