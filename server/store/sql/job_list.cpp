#include "server/store/sql/job_list.h"

#include "base/ids.h"
#include "server/store/microseconds.h"

namespace isomesh::store {

JobListValues::JobListValues(const JobFilter& filter) : volume(filter.volume) {
  if (filter.since) {
    since = to_us(*filter.since);
    first_id = first_id_at(*filter.since);
  }
  if (filter.until) until = to_us(*filter.until);
}

std::string job_list_query(const Viewer& viewer, const JobFilter& filter,
                           const std::string& after) {
  std::string sql = std::string("WHERE ") + (viewer ? "j.owner = ?1" : "?1 IS NULL");
  sql += filter.state ? " AND j.state = ?2" : " AND ?2 IS NULL";
  sql += after.empty() ? " AND ?3 = ''" : " AND j.id < ?3";
  sql += filter.volume ? " AND j.volume = ?5" : " AND ?5 IS NULL";
  // Ids are ordered by time, but those of a clock that was set back continue those before it. So an
  // id is never older than its job, and may be newer.
  sql += filter.since ? " AND j.accepted >= ?6 AND j.id >= ?8" : " AND ?6 IS NULL AND ?8 IS NULL";
  if (filter.until) {
    // The newest of them is found by an index alone, however many are newer.
    sql += std::string(" AND j.accepted < ?7 AND j.id <= (SELECT x.id FROM jobs x WHERE ") +
           (viewer ? "x.owner = ?1 AND " : "") + "x.accepted < ?7 ORDER BY x.id DESC LIMIT 1)";
  } else {
    sql += " AND ?7 IS NULL";
  }
  return sql + " ORDER BY j.id DESC LIMIT ?4";
}

}  // namespace isomesh::store
