// The verbs of the queue as functions of PostgreSQL. Each is one round trip: claims wait for each
// other, so several statements from outside would slow all daemons. The caller computes the records
// of jobs by the rules in job_rules.h, as SQLite's queue does.
#include "server/store/postgresql/schema.h"

namespace isomesh::store::postgresql {

// Created again with each new version of the schema, so a changed function needs a new one.
const char* const kFunctions = R"sql(
-- The key of an advisory lock for all equal jobs. A submission holds it shared while it looks for a finished mesh, so
-- that none is stored meanwhile.
CREATE OR REPLACE FUNCTION alike_lock(p_owner text, p_key text) RETURNS bigint LANGUAGE sql IMMUTABLE AS
  $$ SELECT hashtextextended(p_owner || chr(10) || p_key, 18) $$;

-- Ends a job. The caller has locked or inserted its row. p_blobs: the blobs of its mesh, objects of `blob` and `bytes`.
CREATE OR REPLACE FUNCTION end_job(p_job text, p_state int, p_record text, p_stage text, p_ended_by bigint, p_node uuid,
                                   p_blobs jsonb) RETURNS void LANGUAGE plpgsql AS $$
DECLARE j record; now_us bigint := isomesh_now();
BEGIN
  UPDATE jobs SET state = p_state, finished = isomesh_kept(now_us), record = p_record, waiting_for = NULL,
                  ended_by = coalesce(p_ended_by, ended_by)
    WHERE id = p_job RETURNING owner, volume, receiver, url INTO j;
  UPDATE volumes SET used = greatest(used, isomesh_kept(now_us)) WHERE owner = j.owner AND id = j.volume;
  INSERT INTO meshes SELECT p_job, t.blob, t.bytes FROM jsonb_to_recordset(p_blobs) AS t(blob text, bytes bigint)
    ON CONFLICT DO NOTHING;
  IF j.url IS NOT NULL THEN
    INSERT INTO callbacks(job, receiver, url, body, attempts, created, next)
      VALUES(p_job, j.receiver, j.url, p_record, 0, now_us, now_us);
  END IF;
  INSERT INTO events(node, owner, job, kind, state, stage, progress)
    VALUES(p_node, j.owner, p_job, {event.done}, p_state, p_stage,
           CASE WHEN p_state = {job.succeeded} THEN 1 ELSE 0 END);
END $$;

-- Counts the queued jobs, those that share a part of the queue with jobs of that priority, and those of the owner among
-- them. Urgent jobs have a part for themselves.
CREATE OR REPLACE FUNCTION count_queued(p_owner text, p_priority int, OUT queued bigint, OUT alike bigint, OUT held bigint)
LANGUAGE sql STABLE AS $$
  SELECT count(*), count(*) FILTER (WHERE is_alike), count(*) FILTER (WHERE is_alike AND owner = p_owner)
    FROM (SELECT owner, p_priority <> {priority.stat} OR priority = {priority.stat} AS is_alike
            FROM jobs WHERE state = {job.queued}) AS q
$$;

-- Stores a job. p has the columns of jobs, and
--   latest      the latest succeeded job that is equal, as the caller saw it; null: none
--   reuses      true: the job ends at once with the mesh of `latest`, whose blobs are in `blobs`
--   runs_anew   true: it runs, whatever equal jobs there are
--   most        the limit of queued jobs
--   most_alike  of those, the limit of jobs that share a part of the queue with it
--   is_shared   true: its owner may take no more than a share of that part, as in base/share.h
-- Outcomes:
--   new          the job is stored
--   known        its idempotency key made the returned job, by the same request
--   conflict     as known, but by another request
--   full, no share, no volume
--   look again   `latest` is out of date: repeat with the present one
CREATE OR REPLACE FUNCTION submit_job(p jsonb) RETURNS TABLE(outcome text, job text) LANGUAGE plpgsql AS $$
DECLARE s record; old record; q record; latest text;
BEGIN
  SELECT * INTO s FROM jsonb_to_record(p) AS t(
    id text, owner text, priority int, volume text, result_key text, accepted bigint, receiver text, url text,
    idempotency_key text, request_digest text, record text, cost bigint, version int, node uuid, latest text,
    reuses boolean, runs_anew boolean, blobs jsonb, most bigint, most_alike bigint, is_shared boolean);
  IF EXISTS (SELECT 1 FROM jobs j WHERE j.id = s.id) THEN  -- repeated after a lost connection
    RETURN QUERY SELECT 'new', s.id;
    RETURN;
  END IF;
  IF s.idempotency_key IS NOT NULL THEN
    SELECT j.id, j.request_digest AS digest INTO old FROM jobs j
      WHERE j.owner = s.owner AND j.idempotency_key = s.idempotency_key;
    IF FOUND THEN
      RETURN QUERY SELECT CASE WHEN old.digest = s.request_digest THEN 'known' ELSE 'conflict' END, old.id;
      RETURN;
    END IF;
  END IF;
  PERFORM 1 FROM volumes v WHERE v.owner = s.owner AND v.id = s.volume FOR KEY SHARE;
  IF NOT FOUND THEN RETURN QUERY SELECT 'no volume', NULL::text; RETURN; END IF;
  PERFORM pg_advisory_xact_lock_shared(alike_lock(s.owner, s.result_key));
  IF s.reuses THEN
    -- The other job must not expire before this one names its blobs.
    PERFORM 1 FROM jobs j WHERE j.id = s.latest AND j.state = {job.succeeded} FOR KEY SHARE;
    IF NOT FOUND THEN RETURN QUERY SELECT 'look again', NULL::text; RETURN; END IF;
  ELSE
    SELECT j.id INTO latest FROM jobs j
      WHERE j.owner = s.owner AND j.result_key = s.result_key AND j.state = {job.succeeded} ORDER BY j.id DESC LIMIT 1;
    IF latest IS DISTINCT FROM s.latest AND s.runs_anew IS NOT TRUE THEN
      RETURN QUERY SELECT 'look again', NULL::text;
      RETURN;
    END IF;
    SELECT * INTO q FROM count_queued(s.owner, s.priority);
    -- Near a limit, submissions count one after the other: 256 others may be stored meanwhile, all of this owner or none.
    IF q.queued > s.most - 256 OR (s.is_shared AND q.held + 256 > s.most_alike - q.alike - 256) THEN
      PERFORM pg_advisory_xact_lock(hashtext('isomesh queue'), hashtext(current_schema()));
      SELECT * INTO q FROM count_queued(s.owner, s.priority);
    END IF;
    IF q.queued >= s.most THEN RETURN QUERY SELECT 'full', NULL::text; RETURN; END IF;
    IF s.is_shared AND q.held >= s.most_alike - q.alike THEN
      RETURN QUERY SELECT CASE WHEN q.held > 0 THEN 'no share' ELSE 'full' END, NULL::text;
      RETURN;
    END IF;
  END IF;
  INSERT INTO jobs(id, owner, state, priority, volume, result_key, accepted, receiver, url, idempotency_key,
                   request_digest, record, cost, version)
    VALUES(s.id, s.owner, {job.queued}, s.priority, s.volume, s.result_key, s.accepted, s.receiver, s.url,
           s.idempotency_key, s.request_digest, s.record, s.cost, s.version)
    ON CONFLICT DO NOTHING;
  IF NOT FOUND THEN                    -- another submission with this key was faster
    SELECT j.id, j.request_digest AS digest INTO old FROM jobs j
      WHERE j.owner = s.owner AND j.idempotency_key = s.idempotency_key;
    RETURN QUERY SELECT CASE WHEN old.digest = s.request_digest THEN 'known' ELSE 'conflict' END, old.id;
    RETURN;
  END IF;
  IF s.reuses THEN
    PERFORM end_job(s.id, {job.succeeded}, s.record, {stage.done}, NULL, s.node, s.blobs);
  ELSE
    INSERT INTO events(node, owner, job, kind, state, stage, progress)
      VALUES(s.node, s.owner, s.id, {event.stage}, {job.queued}, {stage.queue}, 0);
  END IF;
  RETURN QUERY SELECT 'new', s.id;
END $$;

-- Claims the next job for a lease of p_lease. Does not wait for the disk: if a power failure of the database reverts the
-- claim, the job is claimed again, and the time in its fence makes that one greater. Claims run one after the other, so
-- each sees the turns that the others took. Jobs of a newer version than p_newest stay for newer daemons. A job of an older
-- version is returned unclaimed, without a fence: the caller updates it to its own version and calls again.
CREATE OR REPLACE FUNCTION claim_job(p_node uuid, p_worker text, p_lease bigint, p_newest int)
RETURNS TABLE(id text, fence bigint, attempts int, owner text, record text, accepted bigint, claimed bigint)
LANGUAGE plpgsql AS $$
DECLARE turn record; c record; now_us bigint; f bigint;
BEGIN
  PERFORM set_config('synchronous_commit', 'off', true);
  PERFORM pg_advisory_xact_lock(hashtext('isomesh claim'), hashtext(current_schema()));
  LOOP
    now_us := isomesh_now();
    SELECT head.id, q.priority, q.start_tag INTO turn FROM queued_owners q CROSS JOIN LATERAL (
        SELECT j.id, j.seq FROM jobs j
          WHERE j.state = {job.queued} AND j.priority = q.priority AND j.owner = q.owner AND j.not_before <= now_us
            AND j.version <= p_newest
            AND NOT EXISTS (SELECT 1 FROM runs r WHERE r.owner = j.owner AND r.result_key = j.result_key)
          ORDER BY j.seq LIMIT 1) AS head
      ORDER BY q.priority, q.start_tag, head.seq LIMIT 1;
    IF NOT FOUND THEN
      DELETE FROM turns;
      RETURN;
    END IF;
    SELECT j.id, j.owner, j.result_key, j.fence, j.attempts, j.record, j.accepted, j.cost, j.version INTO c FROM jobs j
      WHERE j.id = turn.id AND j.state = {job.queued} FOR UPDATE;
    CONTINUE WHEN NOT FOUND;           -- cancelled since the first SELECT
    IF c.version < p_newest THEN
      RETURN QUERY SELECT c.id, NULL::bigint, c.attempts, c.owner, c.record, c.accepted, now_us;
      RETURN;
    END IF;
    f := greatest(c.fence + 1, now_us);
    INSERT INTO runs(job, fence, owner, result_key, node, worker, claimed, lease_until)
      VALUES(c.id, f, c.owner, c.result_key, p_node, p_worker, now_us, now_us + p_lease);
    -- No job of a higher priority is ready, so nobody there is owed a turn.
    DELETE FROM turns t WHERE (t.priority, t.finish_tag) <= (turn.priority, turn.start_tag);
    INSERT INTO turns AS t VALUES(turn.priority, c.owner, turn.start_tag, turn.start_tag + c.cost)
      ON CONFLICT ON CONSTRAINT turns_pkey DO UPDATE SET start_tag = excluded.start_tag, finish_tag = excluded.finish_tag;
    UPDATE jobs j SET state = {job.running}, fence = f, attempts = c.attempts + 1, waiting_for = NULL WHERE j.id = c.id;
    INSERT INTO events(node, owner, job, kind, state, stage, progress)
      VALUES(p_node, c.owner, c.id, {event.stage}, {job.running}, {stage.load}, 0);
    RETURN QUERY SELECT c.id, f, c.attempts + 1, c.owner, c.record, c.accepted, now_us;
    RETURN;
  END LOOP;
END $$;

-- Renews a lease. Returns null if it is lost, otherwise whether the run should stop. A lease that expired during an outage
-- of the database is renewed too: while its row exists, nobody else has the job.
CREATE OR REPLACE FUNCTION renew_run(p_job text, p_fence bigint, p_lease bigint, p_stage text, p_progress float8,
                                     p_timings text) RETURNS boolean LANGUAGE plpgsql AS $$
DECLARE stops boolean; now_us bigint := isomesh_now();
BEGIN
  PERFORM set_config('synchronous_commit', 'off', true);
  UPDATE runs SET lease_until = now_us + p_lease, stage = p_stage, progress = p_progress, timings = p_timings
    WHERE job = p_job AND fence = p_fence RETURNING cancelling INTO stops;
  RETURN stops;
END $$;

-- Ends a run. p has
--   id, fence, node  the run, and the daemon that calls
--   is_again         true: this repeats a call with unknown outcome
--   ends_others      true: the run belongs to another daemon. Its lease must have expired, unless that daemon was an
--                    earlier process on the caller's data folder
--   state, record    the job's new state. If that is queued, no record but
--   delay, waiting_for, counts: when it may run again, what it waits for, whether this attempt counts
--   cancelled        the record to use if the job was cancelled
--   blobs            the mesh's, if it succeeded
--   alike            equal queued jobs that the caller knows of, which end with it: objects of `id` and `record`
--   newest           the newest version of a job that the caller can read
-- Outcomes: 'lost' (the lease), 'done', or 'alike': nothing has changed; repeat with the returned equal jobs in `alike`.
CREATE OR REPLACE FUNCTION finish_run(p jsonb) RETURNS TABLE(outcome text, id text, record text, accepted bigint)
LANGUAGE plpgsql AS $$
DECLARE s record; j record; r record; other record;
BEGIN
  SELECT * INTO s FROM jsonb_to_record(p) AS t(
    id text, fence bigint, node uuid, is_again boolean, ends_others boolean, state int, record text, delay bigint,
    waiting_for int, counts boolean, cancelled text, blobs jsonb, alike jsonb, newest int);
  SELECT t.owner, t.result_key, t.ended_by INTO j FROM jobs t WHERE t.id = s.id FOR UPDATE;
  SELECT t.cancelling, t.lease_until, t.node INTO r FROM runs t WHERE t.job = s.id AND t.fence = s.fence FOR UPDATE;
  IF NOT FOUND OR (s.ends_others AND r.lease_until >= isomesh_now() AND NOT EXISTS (
                     SELECT 1 FROM nodes a JOIN nodes b USING (name) WHERE a.id = r.node AND b.id = s.node
                       AND a.id <> b.id)) THEN
    RETURN QUERY SELECT CASE WHEN s.is_again AND j.ended_by = s.fence THEN 'done' ELSE 'lost' END, NULL::text, NULL::text,
                        0::bigint;
    RETURN;
  END IF;
  IF r.cancelling THEN
    s.state := {job.cancelled};
    s.record := s.cancelled;
  END IF;
  IF s.state = {job.succeeded} THEN
    PERFORM pg_advisory_xact_lock(alike_lock(j.owner, j.result_key));
    IF EXISTS (SELECT 1 FROM jobs a WHERE a.owner = j.owner AND a.result_key = j.result_key AND a.state = {job.queued}
                 AND a.version <= s.newest
                 AND a.id NOT IN (SELECT t.id FROM jsonb_to_recordset(s.alike) AS t(id text))) THEN
      RETURN QUERY SELECT 'alike', a.id, a.record, a.accepted FROM jobs a
        WHERE a.owner = j.owner AND a.result_key = j.result_key AND a.state = {job.queued}
          AND a.version <= s.newest ORDER BY a.id;
      RETURN;
    END IF;
  END IF;
  DELETE FROM runs t WHERE t.job = s.id;
  IF s.state = {job.queued} THEN
    UPDATE jobs t SET state = {job.queued}, attempts = t.attempts - CASE WHEN s.counts THEN 0 ELSE 1 END,
                      not_before = isomesh_now() + s.delay, waiting_for = s.waiting_for, ended_by = s.fence
      WHERE t.id = s.id;
    INSERT INTO events(node, owner, job, kind, state, stage, progress)
      VALUES(s.node, j.owner, s.id, {event.stage}, {job.queued}, {stage.queue}, 0);
  ELSIF s.state = {job.succeeded} THEN
    PERFORM end_job(s.id, {job.succeeded}, s.record, {stage.done}, s.fence, s.node, s.blobs);
    FOR other IN SELECT t.id, t.record FROM jsonb_to_recordset(s.alike) AS t(id text, record text) LOOP
      PERFORM 1 FROM jobs a WHERE a.id = other.id AND a.state = {job.queued} FOR UPDATE;
      CONTINUE WHEN NOT FOUND;         -- cancelled since the caller read it
      PERFORM end_job(other.id, {job.succeeded}, other.record, {stage.done}, NULL, s.node, s.blobs);
    END LOOP;
  ELSE
    PERFORM end_job(s.id, s.state, s.record, {stage.load}, s.fence, s.node, '[]');
  END IF;
  RETURN QUERY SELECT 'done', NULL::text, NULL::text, 0::bigint;
END $$;

-- Cancels a queued job, or asks the run of a running one to stop. Returns the state after that; null: no such job.
CREATE OR REPLACE FUNCTION cancel_job(p_job text, p_record text, p_node uuid) RETURNS int LANGUAGE plpgsql AS $$
DECLARE s int;
BEGIN
  SELECT state INTO s FROM jobs WHERE id = p_job FOR UPDATE;
  IF s = {job.queued} THEN
    PERFORM end_job(p_job, {job.cancelled}, p_record, {stage.queue}, NULL, p_node, '[]');
    RETURN {job.cancelled};
  END IF;
  IF s = {job.running} THEN UPDATE runs SET cancelling = true WHERE job = p_job; END IF;
  RETURN s;
END $$;

-- Reserves due callbacks for a node and returns them. Over all nodes, at most p_most for each receiver are reserved. A
-- time later than a callback may be postponed means that the clock was set back.
CREATE OR REPLACE FUNCTION take_callbacks(p_node uuid, p_now bigint, p_most int, p_hold bigint)
RETURNS TABLE(job text, url text, body text, attempts int, created bigint) LANGUAGE plpgsql AS $$
DECLARE now_us bigint := isomesh_now(); longest bigint := p_now + {callback.longest_us};
BEGIN
  IF NOT EXISTS (SELECT 1 FROM callbacks c WHERE c.next <= p_now OR c.next > longest) THEN RETURN; END IF;
  PERFORM set_config('synchronous_commit', 'off', true);
  PERFORM pg_advisory_xact_lock(hashtext('isomesh callbacks'), hashtext(current_schema()));
  UPDATE callbacks c SET node = p_node, held_until = now_us + p_hold FROM (
    SELECT t.job AS id, row_number() OVER (PARTITION BY t.receiver
             ORDER BY (t.node IS DISTINCT FROM p_node AND t.held_until > now_us) DESC, t.next, t.job) AS place,
           t.node IS DISTINCT FROM p_node AND t.held_until > now_us AS is_others
      FROM callbacks t WHERE t.next <= p_now OR t.next > longest) AS due
    WHERE c.job = due.id AND due.place <= p_most AND NOT due.is_others;
  RETURN QUERY SELECT c.job, c.url, c.body, c.attempts, c.created FROM callbacks c
    WHERE c.node = p_node AND (c.next <= p_now OR c.next > longest) AND c.held_until > now_us ORDER BY c.next, c.job;
END $$;
)sql";

}  // namespace isomesh::store::postgresql
