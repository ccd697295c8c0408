#include "server/store/postgresql/schema.h"

#include <chrono>
#include <string>
#include <thread>

#include "base/log.h"
#include "proto/error.h"
#include "server/store/sql/fair_queue.h"

namespace isomesh::store::postgresql {
namespace {

// Advisory lock that serialises upgrades by several processes.
constexpr std::int64_t kUpgradeLock = 0x69736f6d65736831;  // "isomesh1"

constexpr std::chrono::minutes kLongestUpgrade{10};
constexpr std::chrono::seconds kBetweenUpgrades{1};
// A statement may rewrite a large table. But while it waits for a table, all statements of running
// daemons on that table wait behind it, so it gives way before they fail.
constexpr const char* kUpgradeSession =
    "SET LOCAL statement_timeout = '10min'; SET LOCAL lock_timeout = '1s'";

constexpr const char* kPlace = "the database";

// The service's tables. Times are microseconds since 1970 by the database's clock. A job's record
// is its JSON in the API as submitted, and after its end as ended. Columns and the row of its run
// have what changes in between.
constexpr const char* kTables = R"sql(
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
  blob text COLLATE "C" NOT NULL,      -- of its samples, see Volume::samples
  bytes bigint NOT NULL,               -- of its blob
  record text NOT NULL,                -- without labels
  labelled text,                       -- with them, if there are any
  PRIMARY KEY(owner, id)
);
CREATE INDEX volumes_by_id ON volumes(id);
CREATE INDEX volumes_by_blob ON volumes(blob);
CREATE INDEX volumes_by_use ON volumes(used);
CREATE INDEX volumes_by_time ON volumes(created, id);

CREATE TABLE volume_key(               -- one row: see VolumeStore::key
  key text NOT NULL
);
INSERT INTO volume_key SELECT replace(gen_random_uuid()::text || gen_random_uuid()::text, '-', '');

CREATE SEQUENCE job_order CACHE 1;     -- age is one order for all nodes
CREATE TABLE jobs(
  id text COLLATE "C" PRIMARY KEY,
  seq bigint NOT NULL DEFAULT nextval('job_order'),
  owner text COLLATE "C" NOT NULL,
  state int NOT NULL,
  priority int NOT NULL,
  volume text COLLATE "C" NOT NULL,
  result_key text COLLATE "C" NOT NULL,  -- the same for jobs that make the same mesh
  version int NOT NULL,                -- see JobStoreOptions::job_version
  cost bigint NOT NULL,                -- microseconds that a run is expected to take
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
CREATE INDEX jobs_by_turn ON jobs(priority, owner, seq) WHERE state = {job.queued};
CREATE INDEX jobs_alike ON jobs(owner, result_key, state);
CREATE INDEX jobs_by_volume ON jobs(volume) WHERE state < {job.final};
CREATE INDEX jobs_by_end ON jobs(finished) WHERE finished IS NOT NULL;
CREATE INDEX jobs_by_owner ON jobs(owner, id);
CREATE UNIQUE INDEX jobs_by_key ON jobs(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

CREATE TABLE turns(                    -- of owners' last claims; see fair_queue.h
  priority int NOT NULL,
  owner text COLLATE "C" NOT NULL,
  start_tag bigint NOT NULL,
  finish_tag bigint NOT NULL,
  PRIMARY KEY(priority, owner)
) WITH (fillfactor = 50);

CREATE TABLE runs(                     -- a row is a lease: its holder's until somebody ends it, also after its time
  job text COLLATE "C" PRIMARY KEY REFERENCES jobs(id) ON DELETE CASCADE,
  fence bigint NOT NULL,
  owner text COLLATE "C" NOT NULL,
  result_key text COLLATE "C" NOT NULL,
  node uuid NOT NULL,
  worker text NOT NULL,
  claimed bigint NOT NULL,
  lease_until bigint NOT NULL,
  cancelling boolean NOT NULL DEFAULT false,
  stage text,                          -- these three as of the last renewal
  progress float8,
  timings text,                        -- of the stages that have ended, as JSON
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
  stage text NOT NULL,
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

CREATE TABLE audit(
  id bigint PRIMARY KEY,
  at text NOT NULL,
  record text NOT NULL,
  chain text NOT NULL                  -- see AuditChain
);
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

-- A time that decides how long something is kept is never older than the newest that is known for certain.
CREATE FUNCTION isomesh_kept(us bigint) RETURNS bigint LANGUAGE sql VOLATILE AS
  $$ SELECT greatest(us, (SELECT max(seen) FROM identity)) $$;

CREATE TABLE tasks(                    -- that one process has at a time; see HeldTask
  name text COLLATE "C" PRIMARY KEY,
  node uuid NOT NULL,
  folder text NOT NULL,                -- its data folder; a process that starts there is its successor
  held_until bigint NOT NULL
) WITH (fillfactor = 50);
)sql";

void try_to_upgrade(Connection& connection, const std::vector<Schema>& schemas) {
  Transaction transaction(connection);
  transaction->query("SELECT pg_advisory_xact_lock(?1)", kUpgradeLock);
  transaction->script(kUpgradeSession);
  check_versions(connection, kPlace, schemas);
  if (needs_upgrade(connection, schemas)) {
    store::upgrade(connection, schemas);
    transaction->script(kQueuedOwners);
    transaction->script(kFunctions);
  }
  transaction.commit();
}

}  // namespace

std::vector<Schema> schemas_with(const std::vector<Schema>& components) {
  return with_service(kTables, components);
}

void check_versions(Connection& connection, const std::vector<Schema>& components) {
  store::check_versions(connection, kPlace, schemas_with(components));
}

void upgrade(Connection& connection, const std::vector<Schema>& schemas) {
  const auto end = Connection::Clock::now() + kLongestUpgrade;
  for (bool is_told = false;; is_told = true) {
    try {
      connection.wait_until(Connection::Clock::now() + kLongestUpgrade);
      return try_to_upgrade(connection, schemas);
    } catch (const Interrupted& error) {
      if (!connection.is_open() || Connection::Clock::now() >= end) throw;
      if (!is_told) {
        log_warning(
            "the upgrade of the tables waits until other sessions, such as pg_dump or another "
            "daemon, release them: {}",
            error.what());
      }
    }
    std::this_thread::sleep_for(kBetweenUpgrades);
  }
}

}  // namespace isomesh::store::postgresql
