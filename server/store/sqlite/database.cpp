#include "server/store/sqlite/database.h"

#include <algorithm>
#include <chrono>
#include <string>

#include "proto/error.h"
#include "server/store/file.h"
#include "server/store/sql/fair_queue.h"

namespace isomesh::store {
namespace {

constexpr const char* kPlace = "the data folder";

// The service's tables. A record is the JSON of the API; the other columns serve queries.
constexpr const char* kTables = R"sql(
CREATE TABLE volumes(
  owner TEXT NOT NULL,
  id TEXT NOT NULL,
  created INTEGER NOT NULL,
  used INTEGER NOT NULL,      -- when it was created or a job that needed it ended, whichever is last
  blob TEXT NOT NULL,         -- of its samples, see Volume::samples
  bytes INTEGER NOT NULL,     -- of its blob
  record TEXT NOT NULL,       -- without labels
  labelled TEXT,              -- with them, if there are any
  PRIMARY KEY(owner, id)
) WITHOUT ROWID;
CREATE INDEX volumes_by_id ON volumes(id);
CREATE INDEX volumes_by_blob ON volumes(blob);
CREATE INDEX volumes_by_use ON volumes(used);
CREATE INDEX volumes_by_time ON volumes(created, id);

CREATE TABLE jobs(
  id TEXT NOT NULL PRIMARY KEY,
  owner TEXT NOT NULL,
  state INTEGER NOT NULL,
  priority INTEGER NOT NULL,
  volume TEXT NOT NULL,
  result_key TEXT NOT NULL,   -- the same for jobs that make the same mesh
  cost INTEGER NOT NULL,      -- microseconds that a run is expected to take
  accepted INTEGER NOT NULL,
  finished INTEGER,
  not_before INTEGER NOT NULL,
  waiting_for INTEGER,        -- of queued ones, see WaitingFor
  attempts INTEGER NOT NULL,
  fence INTEGER NOT NULL,
  claimed INTEGER,            -- when its run began, while it runs
  lease_until INTEGER,
  worker TEXT,
  cancelling INTEGER NOT NULL,
  idempotency_key TEXT,
  request_digest TEXT NOT NULL,
  record TEXT NOT NULL
) WITHOUT ROWID;
CREATE INDEX jobs_by_turn ON jobs(priority, owner, id, state) WHERE state = {job.queued};  -- covers the look for owners
CREATE INDEX jobs_waiting ON jobs(waiting_for) WHERE state = {job.queued} AND waiting_for IS NOT NULL;
CREATE INDEX jobs_running ON jobs(lease_until) WHERE state = {job.running};
CREATE INDEX jobs_by_result ON jobs(owner, result_key, state);
CREATE INDEX jobs_by_volume ON jobs(volume) WHERE state < {job.final};
CREATE INDEX jobs_by_end ON jobs(finished) WHERE finished IS NOT NULL;
CREATE INDEX jobs_by_owner ON jobs(owner, id);
CREATE UNIQUE INDEX jobs_by_key ON jobs(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

CREATE TABLE turns(           -- of owners' last claims; see fair_queue.h
  priority INTEGER NOT NULL,
  owner TEXT NOT NULL,
  start_tag INTEGER NOT NULL,
  finish_tag INTEGER NOT NULL,
  PRIMARY KEY(priority, owner)
) WITHOUT ROWID;

CREATE TABLE meshes(          -- which blobs the meshes of which jobs are in
  job TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  blob TEXT NOT NULL,
  bytes INTEGER NOT NULL,
  PRIMARY KEY(job, blob)
) WITHOUT ROWID;
CREATE INDEX meshes_by_blob ON meshes(blob);

CREATE TABLE events(
  id INTEGER PRIMARY KEY,
  owner TEXT NOT NULL,
  job TEXT NOT NULL,
  kind INTEGER NOT NULL,
  state INTEGER NOT NULL,
  stage TEXT NOT NULL,
  progress REAL NOT NULL
);
CREATE INDEX events_by_job ON events(job, id);

CREATE TABLE expired(         -- ids of jobs and volumes that were there
  id TEXT NOT NULL,
  owner TEXT NOT NULL,
  at INTEGER NOT NULL,
  PRIMARY KEY(id, owner)
) WITHOUT ROWID;
CREATE INDEX expired_by_time ON expired(at);

CREATE TABLE callbacks(       -- of jobs that have ended, until they are delivered or given up
  job TEXT NOT NULL PRIMARY KEY,
  receiver TEXT NOT NULL,     -- scheme, host and port
  url TEXT NOT NULL,
  body TEXT NOT NULL,
  attempts INTEGER NOT NULL,  -- that failed
  created INTEGER NOT NULL,
  next INTEGER NOT NULL       -- when it is due
) WITHOUT ROWID;
CREATE INDEX callbacks_by_time ON callbacks(next);

CREATE TABLE volume_key(      -- one row: see VolumeStore::key
  key TEXT NOT NULL
);
INSERT INTO volume_key VALUES(lower(hex(randomblob(32))));

CREATE TABLE identity(        -- one row: see Identity
  id TEXT NOT NULL,
  number INTEGER NOT NULL,
  seen INTEGER NOT NULL
);

CREATE TABLE audit(
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  at TEXT NOT NULL,
  record TEXT NOT NULL,
  chain TEXT NOT NULL         -- see AuditChain
);
CREATE TRIGGER audit_is_not_changed BEFORE UPDATE ON audit
  BEGIN SELECT raise(ABORT, 'the audit trail is not changed'); END;
CREATE TRIGGER audit_is_not_removed BEFORE DELETE ON audit
  BEGIN SELECT raise(ABORT, 'the audit trail is not removed'); END;
CREATE TRIGGER audit_is_not_replaced BEFORE INSERT ON audit
  WHEN EXISTS(SELECT 1 FROM audit WHERE id = new.id)
  BEGIN SELECT raise(ABORT, 'the audit trail is not changed'); END;
CREATE TABLE audit_sent(      -- one row: up to which entry a collector has had the trail
  id INTEGER NOT NULL
);
INSERT INTO audit_sent VALUES(0);
)sql";

std::vector<Schema> with_own(const std::vector<Schema>& components) {
  return with_service(std::string(kTables) + kQueuedOwners, components);
}

// Upgrades the tables before any other access.
Connection::Mode upgraded(const std::filesystem::path& file, const std::vector<Schema>& schemas) {
  // Records may identify patients. SQLite's other files get the access rights of this one.
  if (!std::filesystem::exists(file)) File::create(file);
  Connection connection(file, Connection::Mode::kWrite);
  check_versions(connection, kPlace, schemas);
  if (!needs_upgrade(connection, schemas)) return Connection::Mode::kWrite;
  Transaction transaction(connection);
  upgrade(connection, schemas);
  transaction.commit();
  return Connection::Mode::kWrite;
}

// Size of the write-ahead log at which it is checkpointed: 16 MiB, so that few commits have to
// checkpoint and frequently changed pages are written once; less on a small disk.
std::uint64_t log_bytes(std::uint64_t disk) {
  constexpr std::uint64_t kShare = 256;
  return std::clamp<std::uint64_t>(disk / kShare, std::uint64_t{1} << 20, std::uint64_t{16} << 20);
}

}  // namespace

void check_versions(Connection& connection, const std::vector<Schema>& components) {
  check_versions(connection, kPlace, with_own(components));
}

Database::Database(const DataFolder& folder, const std::vector<Schema>& components)
    : folder_(folder),
      schemas_(with_own(components)),
      writer_(folder.records(), upgraded(folder.records(), schemas_)) {
  const auto disk_responds = [&folder] { return folder.works(); };
  for (auto& reader : readers_) {
    reader = std::make_unique<Connection>(folder.records(), Connection::Mode::kRead);
    // SQLite opens its files at the first read, when there may be no descriptor left.
    const Reading reading(*reader);
    reading->query("SELECT count(*) FROM sqlite_schema").next();
    reader->know_disk(disk_responds);
  }
  writer_.know_disk(disk_responds);
  writer_.know_newest(newest_us_);
  writer_.limit_log(log_bytes(folder.reserve().capacity()));
}

void Database::make_way() {
  folder_.reserve().let_go();
  const Lock writing(writer_.mutex());
  writer_.empty_log();
}

std::int64_t Database::changes() {
  const Reading reading(writer_);
  return reading->all_changes();
}

Connection& Database::reader() {
  for (const auto& reader : readers_) {
    if (!reader->is_busy()) return *reader;
  }
  return *readers_[next_++ % kReaders];
}

void Database::in_transaction(Change kind, const std::function<void(SqlTransaction&)>& act) {
  const auto run = [&] {
    Transaction transaction(writer_,
                            kind == Change::kRepeatable ? Durability::kProcess : Durability::kFull);
    const std::function<void()> commit = [&] { transaction.commit(); };
    SqlTransaction shown(writer_, false, commit);
    act(shown);
  };
  if (kind == Change::kNew) return run();
  freeing(run);
}

std::size_t Database::tell(Change kind, std::string_view sql,
                           std::span<const Parameter> parameters) {
  std::size_t changed = 0;
  in_transaction(kind, [&](SqlTransaction& transaction) {
    changed = transaction->tell(sql, parameters);
    transaction.commit();
  });
  return changed;
}

void Database::while_reading(const std::function<void(SqlConnection&)>& act) {
  const Reading reading(reader());
  act(reading.connection());
}

// Reads all rows, so that nobody waits while they are processed.
Rows Database::ask(std::string_view sql, std::span<const Parameter> parameters) {
  const Reading reading(reader());
  return reading->take(sql, parameters);
}

std::int64_t now_us() { return to_us(std::chrono::system_clock::now()); }

}  // namespace isomesh::store
