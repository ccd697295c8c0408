// The functions that PostgreSQL runs for isomesh; each executes one method in one round trip.
#include "server/store/postgresql/schema.h"

namespace isomesh::store::postgresql {

// Created again with each new version of the schema, so a changed function needs a new one.
const char* const kFunctions = R"sql(
-- Of those that make the same mesh: who submits one looks whether there is a mesh while nobody stores it.
CREATE OR REPLACE FUNCTION alike_lock(p_owner text, p_key text) RETURNS bigint LANGUAGE sql IMMUTABLE AS
  $$ SELECT hashtextextended(p_owner || chr(10) || p_key, 18) $$;

-- A job that the caller has locked, or made, is over. p_blobs are those of its mesh: objects of `blob` and `bytes`.
CREATE OR REPLACE FUNCTION end_job(p_job text, p_state int, p_record text, p_stage int, p_ended_by bigint, p_node uuid,
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

-- p has what a row of jobs has, and
--   latest     the job that made the like of it last, as the caller has seen it; null where there was none
--   reuses     whether it ends at once with the mesh of that job, which is in `blobs`
--   most       how many jobs may be queued
--   has_share  whether the queue has room for one more of its owner
-- The outcome is 'new', 'known' or 'conflict' (its key made that job before, with the same request or another one),
-- 'full', 'no share', 'no volume', or 'look again' where `latest` is another one by now.
CREATE OR REPLACE FUNCTION submit_job(p jsonb) RETURNS TABLE(outcome text, job text) LANGUAGE plpgsql AS $$
DECLARE s record; old record; n bigint; latest text;
BEGIN
  SELECT * INTO s FROM jsonb_to_record(p) AS t(
    id text, owner text, priority int, volume text, result_key text, accepted bigint, receiver text, url text,
    idempotency_key text, request_digest text, record text, cost bigint, version int, node uuid, latest text,
    reuses boolean, blobs jsonb, most bigint, has_share boolean);
  IF EXISTS (SELECT 1 FROM jobs j WHERE j.id = s.id) THEN  -- asked again after a lost connection
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
    -- Not to expire before this one names its blobs, too.
    PERFORM 1 FROM jobs j WHERE j.id = s.latest AND j.state = {job.succeeded} FOR KEY SHARE;
    IF NOT FOUND THEN RETURN QUERY SELECT 'look again', NULL::text; RETURN; END IF;
  ELSE
    SELECT j.id INTO latest FROM jobs j
      WHERE j.owner = s.owner AND j.result_key = s.result_key AND j.state = {job.succeeded} ORDER BY j.id DESC LIMIT 1;
    IF latest IS DISTINCT FROM s.latest THEN RETURN QUERY SELECT 'look again', NULL::text; RETURN; END IF;
    SELECT count(*) INTO n FROM (SELECT 1 FROM jobs j WHERE j.state = {job.queued} LIMIT s.most) AS q;
    IF n > s.most - 256 THEN           -- near the limit: one at a time, counted again
      PERFORM pg_advisory_xact_lock(hashtext('isomesh queue'), hashtext(current_schema()));
      SELECT count(*) INTO n FROM (SELECT 1 FROM jobs j WHERE j.state = {job.queued} LIMIT s.most) AS q;
      IF n >= s.most THEN RETURN QUERY SELECT 'full', NULL::text; RETURN; END IF;
    END IF;
    IF NOT s.has_share THEN RETURN QUERY SELECT 'no share', NULL::text; RETURN; END IF;
  END IF;
  INSERT INTO jobs(id, owner, state, priority, volume, result_key, accepted, receiver, url, idempotency_key,
                   request_digest, record, cost, version)
    VALUES(s.id, s.owner, {job.queued}, s.priority, s.volume, s.result_key, s.accepted, s.receiver, s.url,
           s.idempotency_key, s.request_digest, s.record, s.cost, s.version)
    ON CONFLICT DO NOTHING;
  IF NOT FOUND THEN                    -- two with one key
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

-- A claim that is lost with the database's power is made again, so it does not wait for the disk. The fence is
-- never one that a lost claim had: the time is in it. Claims are made one after the other, so that each sees the turns
-- that the others have taken. Jobs of a newer version than p_newest wait for a newer daemon. An older one is not claimed
-- but returned without a fence: the caller adopts it and claims again.
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
    CONTINUE WHEN NOT FOUND;           -- cancelled meanwhile
    IF c.version < p_newest THEN
      RETURN QUERY SELECT c.id, NULL::bigint, c.attempts, c.owner, c.record, c.accepted, now_us;
      RETURN;
    END IF;
    f := greatest(c.fence + 1, now_us);
    INSERT INTO runs(job, fence, owner, result_key, node, worker, claimed, lease_until)
      VALUES(c.id, f, c.owner, c.result_key, p_node, p_worker, now_us, now_us + p_lease);
    -- Nothing of a higher priority is ready.
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

-- Null when the lease is lost, otherwise whether the run is to stop. One that ran out while the database was away is
-- renewed, too: nobody has taken the job while the row is there.
CREATE OR REPLACE FUNCTION renew_run(p_job text, p_fence bigint, p_lease bigint, p_stage int, p_progress float8,
                                     p_timings text) RETURNS boolean LANGUAGE plpgsql AS $$
DECLARE stops boolean; now_us bigint := isomesh_now();
BEGIN
  PERFORM set_config('synchronous_commit', 'off', true);
  UPDATE runs SET lease_until = now_us + p_lease, stage = p_stage, progress = p_progress, timings = p_timings
    WHERE job = p_job AND fence = p_fence RETURNING cancelling INTO stops;
  RETURN stops;
END $$;

-- p has
--   id, fence, node  whose run ends
--   is_again         whether the same was asked for before
--   ends_others      it is somebody else's lease, which has to be over, unless it is of an earlier life of the node
--   state, record    of the job from now on; queued: without a record, and with
--   delay, waiting_for, counts: when it may run again, what it waits for, whether this was an attempt
--   cancelled        the record, should it have been asked to stop
--   blobs            of the mesh of one that succeeded
--   alike            those like it that end with it, as far as the caller knows: objects of `id` and `record`
--   newest           the version of those that the caller can read
-- The outcome is 'lost' (the lease), 'done', or 'alike': these jobs are to be told of, too.
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
      CONTINUE WHEN NOT FOUND;         -- cancelled meanwhile
      PERFORM end_job(other.id, {job.succeeded}, other.record, {stage.done}, NULL, s.node, s.blobs);
    END LOOP;
  ELSE
    PERFORM end_job(s.id, s.state, s.record, {stage.load}, s.fence, s.node, '[]');
  END IF;
  RETURN QUERY SELECT 'done', NULL::text, NULL::text, 0::bigint;
END $$;

-- The state that the job is in afterwards.
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

-- Takes deliveries for one node: no receiver is told more at once than `p_most`, over all nodes.
CREATE OR REPLACE FUNCTION take_callbacks(p_node uuid, p_now bigint, p_most int, p_hold bigint)
RETURNS TABLE(job text, url text, body text, attempts int, created bigint) LANGUAGE plpgsql AS $$
DECLARE now_us bigint := isomesh_now();
BEGIN
  IF NOT EXISTS (SELECT 1 FROM callbacks c WHERE c.next <= p_now) THEN RETURN; END IF;
  PERFORM set_config('synchronous_commit', 'off', true);
  PERFORM pg_advisory_xact_lock(hashtext('isomesh callbacks'), hashtext(current_schema()));
  UPDATE callbacks c SET node = p_node, held_until = now_us + p_hold FROM (
    SELECT t.job AS id, row_number() OVER (PARTITION BY t.receiver
             ORDER BY (t.node IS DISTINCT FROM p_node AND t.held_until > now_us) DESC, t.next, t.job) AS place,
           t.node IS DISTINCT FROM p_node AND t.held_until > now_us AS is_others
      FROM callbacks t WHERE t.next <= p_now) AS due
    WHERE c.job = due.id AND due.place <= p_most AND NOT due.is_others;
  RETURN QUERY SELECT c.job, c.url, c.body, c.attempts, c.created FROM callbacks c
    WHERE c.node = p_node AND c.next <= p_now AND c.held_until > now_us ORDER BY c.next, c.job;
END $$;
)sql";

}  // namespace isomesh::store::postgresql
