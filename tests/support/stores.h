// Steps with stores that tests of many components share.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::test {

inline store::Blob put(store::BlobStore& blobs, std::string_view text,
                       const std::string& owner = "") {
  const auto writer = blobs.begin(owner);
  writer->write(as_span(text));
  return writer->commit();
}

inline std::string get(const store::BlobStore& blobs, const std::string& key) {
  const auto blob = blobs.open(key);
  std::string text(blob->size(), '\0');
  blob->read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

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

// The events of a job after `since`, once there are as many as `count`; fewer after kLongest. On
// PostgreSQL they can be read only shortly after the change that they tell of.
inline std::vector<store::Event> events_of(const store::JobStore& jobs, const store::Viewer& viewer,
                                           const std::string& id, std::size_t count,
                                           std::uint64_t since = 0) {
  std::vector<store::Event> events;
  eventually([&] {
    events = jobs.events(viewer, id, since, std::chrono::milliseconds(0));
    return events.size() >= count;
  });
  return events;
}

}  // namespace isomesh::test
