// The query of a list of jobs. For engines only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/job_store.h"

namespace isomesh::store {

// The values of the query's parameters from ?5 on. Those of times are in the tables' form: times of
// a list are compared with those that jobs tell, so no clock shifts them.
struct JobListValues {
  explicit JobListValues(const JobFilter& filter);

  std::optional<std::string> volume;    // ?5
  std::optional<std::int64_t> since;    // ?6
  std::optional<std::int64_t> until;    // ?7
  std::optional<std::string> first_id;  // ?8: no job of since or later has a smaller id
};

// The end of a query of `jobs j`, from WHERE on, that lists them newest first: at most ?4 of the
// viewer ?1 in state ?2 with smaller ids than ?3, which may be empty. Conditions that are absent
// from the text let each list use an index: it reads few jobs that it does not return.
std::string job_list_query(const Viewer& viewer, const JobFilter& filter, const std::string& after);

}  // namespace isomesh::store
