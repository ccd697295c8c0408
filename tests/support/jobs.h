#pragma once

#include <cstdint>
#include <string>

#include "server/store/job_store.h"
#include "tests/support/process.h"

namespace isomesh::test {

// The job in its final state, or after kLongest without an event.
inline Job end_of(const store::JobStore& jobs, const store::Viewer& viewer, const std::string& id) {
  std::uint64_t since = 0;
  while (true) {
    const Job job = jobs.get(viewer, id);
    if (is_final(job.state)) return job;
    const auto events = jobs.events(viewer, id, since, kLongest);
    if (events.empty()) return job;
    since = events.back().id;
  }
}

}  // namespace isomesh::test
