// Whose turn it is in the queue: start-time fair queuing (Goyal, Vin and Cheng, SIGCOMM 1996). For
// engines only.
//
// Within a priority, each owner's oldest ready job has a start tag, and the least one is claimed. A
// job's start tag is the finish tag of its owner's last claim, or the virtual time where the owner
// has none: that is the start tag of the priority's last claim. The finish tag is the start tag and
// the job's expected run time. So an owner that was idle saves nothing up, and of two that both
// have ready jobs neither is ever claimed more than one job of each ahead of the other. A claim
// that finds nothing ready in a priority forgets its tags: while nobody waits, nobody is owed.
//
// All is evaluated by the claim. A submission changes no tag, so submissions do not wait for each
// other, and jobs that are cancelled or reuse a mesh cost their owner nothing.
#pragma once

namespace isomesh::store {

// Owners with queued jobs, each with the start tag of its next job; found by one step of the index
// from owner to owner, however many jobs they have. The numbers are the values of Priority. Tables
// are in each engine: `turns` has no row whose finish tag is not beyond the virtual time.
inline constexpr const char* kQueuedOwners = R"sql(
DROP VIEW IF EXISTS queued_owners;
CREATE VIEW queued_owners AS
  WITH RECURSIVE queued(priority, virtual_time, owner) AS (
    SELECT column1, (SELECT coalesce(max(t.start_tag), 0) FROM turns t WHERE t.priority = column1),
           (SELECT min(j.owner) FROM jobs j WHERE j.state = 0 AND j.priority = column1)
      FROM (VALUES(0), (1), (2)) AS priorities
    UNION ALL
    SELECT q.priority, q.virtual_time, (SELECT min(j.owner) FROM jobs j
                                          WHERE j.state = 0 AND j.priority = q.priority AND j.owner > q.owner)
      FROM queued q WHERE q.owner IS NOT NULL
  )
  SELECT q.priority, q.owner, coalesce(t.finish_tag, q.virtual_time) AS start_tag
    FROM queued q LEFT JOIN turns t ON t.priority = q.priority AND t.owner = q.owner WHERE q.owner IS NOT NULL;
)sql";

}  // namespace isomesh::store
