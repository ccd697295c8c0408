// Turns of owners in the queue: start-time fair queuing (Goyal, Vin and Cheng, SIGCOMM 1996). For
// engines only.
//
// Within a priority, each owner's oldest ready job has a start tag, and the job with the least tag
// is claimed. A job's start tag is the finish tag of its owner's last claim. If the owner has none,
// it is the virtual time: the start tag of the priority's last claim. The finish tag is the start
// tag plus the job's expected run time. So an idle owner accumulates no credit, and while two
// owners have ready jobs, one gets ahead of the other by at most one job of each. A claim that
// finds no ready job in a priority deletes its tags: while nobody waits, nobody is owed anything.
//
// The claim computes everything. A submission changes no tag, so submissions do not block each
// other, and jobs that are cancelled or reuse a mesh cost their owner nothing.
#pragma once

namespace isomesh::store {

// Owners with queued jobs, each with the start tag of its next job. Takes one index step per owner,
// however many jobs they have. Each engine has its own
// tables; `turns` has only rows whose finish tag is beyond the virtual time.
inline constexpr const char* kQueuedOwners = R"sql(
DROP VIEW IF EXISTS queued_owners;
CREATE VIEW queued_owners AS
  WITH RECURSIVE queued(priority, virtual_time, owner) AS (
    SELECT column1, (SELECT coalesce(max(t.start_tag), 0) FROM turns t WHERE t.priority = column1),
           (SELECT min(j.owner) FROM jobs j WHERE j.state = {job.queued} AND j.priority = column1)
      FROM (VALUES({priority.stat}), ({priority.routine}), ({priority.bulk})) AS priorities
    UNION ALL
    SELECT q.priority, q.virtual_time, (SELECT min(j.owner) FROM jobs j
                                          WHERE j.state = {job.queued} AND j.priority = q.priority AND j.owner > q.owner)
      FROM queued q WHERE q.owner IS NOT NULL
  )
  SELECT q.priority, q.owner, coalesce(t.finish_tag, q.virtual_time) AS start_tag
    FROM queued q LEFT JOIN turns t ON t.priority = q.priority AND t.owner = q.owner WHERE q.owner IS NOT NULL;
)sql";

}  // namespace isomesh::store
