#include "server/store/postgresql/schema.h"

#include <array>
#include <chrono>
#include <string>
#include <thread>

#include "base/log.h"
#include "proto/error.h"
#include "server/store/sql/audit_trail.h"
#include "server/store/sql/fair_queue.h"

namespace isomesh::store::postgresql {
namespace {

// Advisory lock that serialises migrations by several processes.
constexpr std::int64_t kMigrationLock = 0x69736f6d65736831;  // "isomesh1"

constexpr std::chrono::minutes kLongestMigration{10};
constexpr std::chrono::seconds kBetweenMigrations{1};
// A statement may rewrite a large table. But while it waits for a table, all statements of running
// daemons on that table wait behind it, so it gives way before they fail.
constexpr const char* kMigrationSession =
    "SET LOCAL statement_timeout = '10min'; SET LOCAL lock_timeout = '1s'";

// The tables of the first version, then the changes of each later one. Only append; never edit a
// released version.
//
// Times are microseconds since 1970 by the
// database's clock. A job's record is its JSON in the API as submitted, and after its end as ended.
// Columns and the row of its run have what changes in between.
constexpr std::array kTables = {R"sql(
CREATE FUNCTION isomesh_now() RETURNS bigint LANGUAGE sql VOLATILE AS
  $$ SELECT (extract(epoch FROM clock_timestamp()) * 1000000)::bigint $$;

-- Of the open transaction; unlike row numbers it is known when the row is written.
CREATE FUNCTION isomesh_next_in_transaction() RETURNS int LANGUAGE sql VOLATILE AS $$
  SELECT set_config('isomesh.place', (coalesce(nullif(current_setting('isomesh.place', true), ''), '0')::int + 1)::text,
                    true)::int $$;

CREATE TABLE nodes(                    -- a row is one life of a process
  id uuid PRIMARY KEY,
  name text COLLATE "C" NOT NULL,      -- of its data folder, which has one process at a time
  since bigint NOT NULL
);

CREATE TABLE volumes(
  owner text COLLATE "C" NOT NULL,
  id text COLLATE "C" NOT NULL,
  created bigint NOT NULL,
  used bigint NOT NULL,                -- when it was created or a job that needed it ended, whichever is last
  bytes bigint NOT NULL,               -- of its blob
  record text NOT NULL,                -- without labels
  labelled text,                       -- with them, if there are any
  PRIMARY KEY(owner, id)
);
CREATE INDEX volumes_by_blob ON volumes(id);
CREATE INDEX volumes_by_use ON volumes(used);
CREATE INDEX volumes_by_time ON volumes(created, id);

CREATE SEQUENCE job_order CACHE 1;     -- age is one order for all nodes
CREATE TABLE jobs(
  id text COLLATE "C" PRIMARY KEY,
  seq bigint NOT NULL DEFAULT nextval('job_order'),
  owner text COLLATE "C" NOT NULL,
  state int NOT NULL,
  priority int NOT NULL,
  volume text COLLATE "C" NOT NULL,
  result_key text COLLATE "C" NOT NULL,  -- the same for jobs that make the same mesh
  accepted bigint NOT NULL,
  finished bigint,
  not_before bigint NOT NULL DEFAULT 0,
  attempts int NOT NULL DEFAULT 0,
  fence bigint NOT NULL DEFAULT 0,     -- of its last run
  ended_by bigint,                     -- the fence of the run that ended last: asked again, it is the same end
  waiting_for int,                     -- of queued ones
  receiver text,                       -- of its callback: scheme, host and port
  url text,
  idempotency_key text COLLATE "C",
  request_digest text NOT NULL,
  record text NOT NULL
) WITH (fillfactor = 70);
CREATE INDEX jobs_queue ON jobs(priority, seq) WHERE state = {job.queued};
CREATE INDEX jobs_alike ON jobs(owner, result_key, state);
CREATE INDEX jobs_by_volume ON jobs(volume) WHERE state < {job.final};
CREATE INDEX jobs_by_end ON jobs(finished) WHERE finished IS NOT NULL;
CREATE INDEX jobs_by_owner ON jobs(owner, id);
CREATE UNIQUE INDEX jobs_by_key ON jobs(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

CREATE TABLE runs(                     -- a row is a lease
  job text COLLATE "C" PRIMARY KEY REFERENCES jobs(id) ON DELETE CASCADE,
  fence bigint NOT NULL,
  owner text COLLATE "C" NOT NULL,
  result_key text COLLATE "C" NOT NULL,
  node uuid NOT NULL,
  worker text NOT NULL,
  claimed bigint NOT NULL,
  lease_until bigint NOT NULL,
  cancelling boolean NOT NULL DEFAULT false,
  stage int,                           -- these three as of the last renewal
  progress float8,
  timing float8[],
  CONSTRAINT runs_one_of_those_alike UNIQUE(owner, result_key)
) WITH (fillfactor = 50);

CREATE TABLE meshes(                   -- which blobs the meshes of which jobs are in
  job text COLLATE "C" NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  blob text COLLATE "C" NOT NULL,
  bytes bigint NOT NULL,
  PRIMARY KEY(job, blob)
);
CREATE INDEX meshes_by_blob ON meshes(blob);

CREATE TABLE events(                   -- ordered by transaction and place in it
  tx bigint NOT NULL DEFAULT pg_current_xact_id()::text::bigint,
  place int NOT NULL DEFAULT isomesh_next_in_transaction(),
  node uuid NOT NULL,
  owner text COLLATE "C" NOT NULL,
  job text COLLATE "C" NOT NULL,
  kind int NOT NULL,
  state int NOT NULL,
  stage int NOT NULL,
  progress float8 NOT NULL,
  at bigint NOT NULL DEFAULT isomesh_now(),
  PRIMARY KEY(tx, place)
);
CREATE INDEX events_by_job ON events(job, tx, place);
CREATE INDEX events_by_time ON events(at);

CREATE TABLE callbacks(                -- of jobs that have ended, until they are delivered or given up
  job text COLLATE "C" PRIMARY KEY,
  receiver text NOT NULL,
  url text NOT NULL,
  body text NOT NULL,
  attempts int NOT NULL,               -- that failed
  created bigint NOT NULL,
  next bigint NOT NULL,                -- when it is due
  node uuid,                           -- who delivers it
  held_until bigint NOT NULL DEFAULT 0 -- and until when nobody else does
);
CREATE INDEX callbacks_by_time ON callbacks(next);

CREATE TABLE expired(                  -- ids of jobs and volumes that were there
  id text COLLATE "C" NOT NULL,
  owner text COLLATE "C" NOT NULL,
  at bigint NOT NULL,
  PRIMARY KEY(id, owner)
);
CREATE INDEX expired_by_time ON expired(at);

CREATE TABLE orders(                   -- states from {order.final} on are final
  id text COLLATE "C" PRIMARY KEY,
  owner text COLLATE "C" NOT NULL,
  state int NOT NULL,
  rule text COLLATE "C",
  created bigint NOT NULL,
  finished bigint,
  next bigint NOT NULL,                -- when it is due, while it is open
  idempotency_key text COLLATE "C",
  request_digest text NOT NULL,
  record text NOT NULL,                -- the JSON of the API
  work text NOT NULL                   -- what the API does not tell
);
CREATE INDEX orders_due ON orders(next) WHERE state < {order.final};
CREATE INDEX orders_by_owner ON orders(owner, id);
CREATE INDEX orders_by_end ON orders(finished) WHERE finished IS NOT NULL;
CREATE UNIQUE INDEX orders_by_key ON orders(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

CREATE TABLE order_blobs(              -- objects that are about to be sent
  "order" text COLLATE "C" NOT NULL REFERENCES orders(id) ON DELETE CASCADE,
  blob text COLLATE "C" NOT NULL,
  PRIMARY KEY("order", blob)
);
CREATE INDEX order_blobs_by_blob ON order_blobs(blob);

CREATE TABLE watched(                  -- series that rules have made orders of
  rule text COLLATE "C" NOT NULL,
  study text COLLATE "C" NOT NULL,
  series text COLLATE "C" NOT NULL,
  "order" text COLLATE "C" NOT NULL,   -- the last one
  instances bigint NOT NULL,           -- as many as there were for that
  seen bigint NOT NULL,
  PRIMARY KEY(rule, study, series)
);
CREATE INDEX watched_by_order ON watched("order");
CREATE INDEX watched_by_time ON watched(seen);

CREATE TABLE received(                 -- instances that peers have sent; see ReceivedStore
  route text COLLATE "C" NOT NULL,
  study text COLLATE "C" NOT NULL,
  series text COLLATE "C" NOT NULL,
  instance text COLLATE "C" NOT NULL,
  blob text COLLATE "C",               -- while it is held
  bytes bigint NOT NULL,
  at bigint NOT NULL,
  PRIMARY KEY(route, study, series, instance)
);
CREATE INDEX received_by_blob ON received(blob) WHERE blob IS NOT NULL;

CREATE TABLE audit(id bigint PRIMARY KEY, at text NOT NULL, record text NOT NULL);
CREATE FUNCTION isomesh_keep_audit() RETURNS trigger LANGUAGE plpgsql AS $$
  BEGIN RAISE EXCEPTION 'the audit trail is neither changed nor removed'; END $$;
CREATE TRIGGER audit_is_kept BEFORE UPDATE OR DELETE OR TRUNCATE ON audit
  FOR EACH STATEMENT EXECUTE FUNCTION isomesh_keep_audit();
CREATE TABLE audit_sent(id bigint NOT NULL);  -- one row: up to which entry a collector has had the trail
INSERT INTO audit_sent VALUES(0);

CREATE TABLE identity(                 -- one row: what the blobs that belong to it carry, too
  id text NOT NULL,
  seen bigint NOT NULL
);
)sql",
                                R"sql(
-- Of the stages that have ended, by name: JSON as of the last renewal. `timing` is of daemons of the first version, which
-- may still run beside newer ones.
ALTER TABLE runs ADD COLUMN timings text;
)sql",
                                R"sql(
-- A time that decides how long something is kept is never older than the newest that is known for certain.
CREATE OR REPLACE FUNCTION isomesh_kept(us bigint) RETURNS bigint LANGUAGE sql VOLATILE AS
  $$ SELECT greatest(us, (SELECT max(seen) FROM identity)) $$;
)sql",
                                R"sql(
ALTER TABLE audit ADD COLUMN IF NOT EXISTS chain text;  -- see AuditChain; none in entries of versions before
)sql",
                                R"sql(
COMMENT ON TABLE runs IS 'leases: a row is its holder''s until somebody ends it, also after its time';
)sql",
                                R"sql(
ALTER TABLE jobs ADD COLUMN cost bigint NOT NULL DEFAULT 1000000;  -- microseconds that a run is expected to take
DROP INDEX jobs_queue;
CREATE INDEX jobs_by_turn ON jobs(priority, owner, seq) WHERE state = {job.queued};
CREATE TABLE turns(                    -- of owners' last claims; see fair_queue.h
  priority int NOT NULL,
  owner text COLLATE "C" NOT NULL,
  start_tag bigint NOT NULL,
  finish_tag bigint NOT NULL,
  PRIMARY KEY(priority, owner)
) WITH (fillfactor = 50);
)sql",
                                R"sql(
CREATE TABLE tasks(                    -- that one process has at a time; see HeldTask
  name text COLLATE "C" PRIMARY KEY,
  node uuid NOT NULL,
  folder text NOT NULL,                -- its data folder; a process that starts there is its successor
  held_until bigint NOT NULL
) WITH (fillfactor = 50);
)sql",
                                R"sql(
ALTER TABLE jobs ADD COLUMN version int NOT NULL DEFAULT 1;  -- see JobStoreOptions::job_version
DROP FUNCTION IF EXISTS claim_job(uuid, text, bigint);
)sql"};

constexpr std::int64_t kChained = 4;  // the first version whose audit trail has digests
constexpr auto kNewest = static_cast<std::int64_t>(kTables.size());

std::int64_t version_of(Connection& connection) {
  Rows row = connection.query("SELECT version FROM isomesh_version");
  const std::int64_t version = row.next() ? row.integer(0) : 0;
  if (version > kNewest) {
    throw Error(ErrorCode::kUnavailable,
                "the database was made by a newer isomeshd: its records have version " +
                    std::to_string(version) + ", this isomeshd reads versions 1 to " +
                    std::to_string(kNewest));
  }
  return version;
}

void try_to_migrate(Connection& connection) {
  Transaction transaction(connection);
  transaction->query("SELECT pg_advisory_xact_lock(?1)", kMigrationLock);
  transaction->script(kMigrationSession);
  transaction->script("CREATE TABLE IF NOT EXISTS isomesh_version(version int NOT NULL)");
  const std::int64_t version = version_of(connection);
  if (version == 0) transaction->query("INSERT INTO isomesh_version VALUES(0)");
  for (std::int64_t next = version; next < kNewest; ++next) {
    transaction->script(kTables[static_cast<std::size_t>(next)]);
  }
  if (version < kNewest) {
    transaction->script(kQueuedOwners);
    transaction->script(kFunctions);
    transaction->query("UPDATE isomesh_version SET version = ?1", kNewest);
  }
  transaction.commit();
}

}  // namespace

void migrate(Connection& connection) {
  const auto end = Connection::Clock::now() + kLongestMigration;
  for (bool is_told = false;; is_told = true) {
    try {
      connection.wait_until(Connection::Clock::now() + kLongestMigration);
      return try_to_migrate(connection);
    } catch (const Interrupted& error) {
      if (!connection.is_open() || Connection::Clock::now() >= end) throw;
      if (!is_told) {
        log_warning(
            "the upgrade of the tables waits until other sessions, such as pg_dump or another "
            "daemon, release them: {}",
            error.what());
      }
    }
    std::this_thread::sleep_for(kBetweenMigrations);
  }
}

void check_has_trail(Connection& connection) {
  Rows found = connection.query("SELECT to_regclass('isomesh_version') IS NOT NULL");
  found.next();
  if (found.integer(0) == 0) {
    throw Error(ErrorCode::kNotFound, "the database has no data of isomeshd");
  }
  refuse_old_trail(version_of(connection), kChained);
}

}  // namespace isomesh::store::postgresql
