#include "server/store/postgresql/move.h"

#include <array>
#include <filesystem>
#include <vector>

#include "base/files.h"
#include "base/ids.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/store/files/blob_store.h"
#include "server/store/outbox.h"
#include "server/store/postgresql/database.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store::postgresql {
namespace {

using Source = store::Connection;

// A table of SQLite's and the columns of PostgreSQL's that take its rows.
struct Table {
  const char* columns;  // with the table's name
  const char* rows;
  int count;
};

// Events stay behind: their numbers are of another kind, and nobody waits for them.
constexpr std::array kAsTheyAre = {
    Table{"meshes(job, blob, bytes)", "SELECT job, blob, bytes FROM meshes", 3},
    Table{"callbacks(job, receiver, url, body, attempts, created, next)",
          "SELECT job, receiver, url, body, attempts, created, next FROM callbacks", 7},
    Table{"expired(id, owner, at)", "SELECT id, owner, at FROM expired", 3},
    Table{"orders(id, owner, state, rule, created, finished, next, idempotency_key, "
          "request_digest, record, work)",
          "SELECT id, owner, state, rule, created, finished, next, idempotency_key, "
          "coalesce(request_digest, ''), record, work FROM orders",
          11},
    Table{"order_blobs(\"order\", blob)", "SELECT \"order\", blob FROM order_blobs", 2},
    Table{"watched(rule, study, series, \"order\", instances, seen)",
          "SELECT rule, study, series, \"order\", instances, seen FROM watched", 6},
    Table{"received(route, study, series, instance, blob, bytes, at)",
          "SELECT route, study, series, instance, blob, bytes, at FROM received", 7},
    Table{"audit(id, at, record)", "SELECT id, at, record FROM audit ORDER BY id", 3}};

Parameter text_of(const Query& row, int column) {
  return row.is_null(column) ? std::nullopt : Parameter(row.text(column));
}

std::string insertion(const Table& table) {
  std::string sql = std::string("INSERT INTO ") + table.columns + " VALUES(";
  for (int n = 1; n <= table.count; ++n) sql += (n > 1 ? ", $" : "$") + std::to_string(n);
  return sql + ')';
}

std::uint64_t copy(Source& from, Connection& to, const Table& table) {
  const std::string sql = insertion(table);
  std::uint64_t count = 0;
  Query rows = from.query(table.rows);
  for (; rows.next(); ++count) {
    std::vector<Parameter> values;
    for (int column = 0; column < table.count; ++column) values.push_back(text_of(rows, column));
    to.execute(sql, values);
  }
  return count;
}

std::uint64_t copy_volumes(Source& from, Connection& to) {
  constexpr Table kTable = {"volumes(owner, id, created, used, bytes, record, labelled)",
                            "SELECT owner, id, created, used, bytes, record FROM volumes", 7};
  const std::string sql = insertion(kTable);
  std::uint64_t count = 0;
  Query rows = from.query(kTable.rows);
  for (; rows.next(); ++count) {
    Volume listed = volume_from_record(rows.text(5));
    const bool has_labels = !listed.labels.empty();
    listed.labels.clear();
    std::vector<Parameter> values;
    for (int column = 0; column < 5; ++column) values.push_back(text_of(rows, column));
    values.emplace_back(to_record(listed));
    values.push_back(has_labels ? Parameter(rows.text(5)) : std::nullopt);
    to.execute(sql, values);
  }
  return count;
}

// In the order of their ids, which is that of their age.
std::uint64_t copy_jobs(Source& from, Connection& to) {
  constexpr Table kTable = {
      "jobs(id, owner, state, priority, volume, result_key, accepted, finished, not_before, "
      "attempts, fence, waiting_for, idempotency_key, request_digest, record, receiver, url)",
      "SELECT id, owner, state, priority, volume, result_key, accepted, finished, not_before, "
      "attempts, fence, waiting_for, idempotency_key, coalesce(request_digest, ''), record FROM "
      "jobs ORDER BY id",
      17};
  const std::string sql = insertion(kTable);
  std::uint64_t count = 0;
  Query rows = from.query(kTable.rows);
  for (; rows.next(); ++count) {
    std::vector<Parameter> values;
    for (int column = 0; column < 15; ++column) values.push_back(text_of(rows, column));
    const auto callback = job_from_record(rows.text(14)).parameters.callback;
    values.push_back(callback ? Parameter(receiver_of(callback->url)) : std::nullopt);
    values.push_back(callback ? Parameter(callback->url) : std::nullopt);
    to.execute(sql, values);
  }
  return count;
}

// What the folder's blobs are called, which the database is called from now on.
std::string name_of_blobs(Source& from) {
  Query row = from.query("SELECT id FROM identity");
  return row.next() ? row.text(0) : random_hex(16);
}

}  // namespace

Moved move_records(const DataFolder& folder, const std::string& url) {
  if (!std::filesystem::exists(folder.records())) {
    throw Error(ErrorCode::kInvalidParameter, "the data folder has no records to move");
  }
  store::Database source(folder);
  // Nobody runs what ran: it is queued there as it is here.
  SqliteJobStore(source, FileBlobStore(folder), {}).reap();
  const store::Reading reading(source.writer());
  Database target({.url = url, .node = "move " + random_hex(8), .connections = 1});
  return target.ask([&](Connection& to, bool) {
    Transaction transaction(to);
    transaction->run("LOCK TABLE volumes, jobs, orders, audit, identity IN EXCLUSIVE MODE");
    const bool is_used = transaction
                             ->run(
                                 "SELECT 1 FROM volumes UNION ALL SELECT 1 FROM jobs UNION ALL "
                                 "SELECT 1 FROM orders UNION ALL SELECT 1 FROM audit LIMIT 1")
                             .next();
    if (is_used) {
      throw Error(ErrorCode::kInvalidParameter,
                  "the database already has records: name an empty one");
    }
    Moved moved;
    moved.volumes = copy_volumes(reading.connection(), to);
    moved.jobs = copy_jobs(reading.connection(), to);
    for (const Table& table : kAsTheyAre) {
      const std::uint64_t count = copy(reading.connection(), to, table);
      if (std::string_view(table.columns).starts_with("orders(")) moved.orders = count;
    }
    {
      Query row = reading->query("SELECT id FROM audit_sent");
      row.next();
      transaction->run("UPDATE audit_sent SET id = $1::bigint", row.integer(0));
    }
    transaction->run("DELETE FROM identity");
    transaction->run("INSERT INTO identity VALUES($1::text, isomesh_now())",
                     name_of_blobs(reading.connection()));
    transaction.commit();
    return moved;
  });
}

}  // namespace isomesh::store::postgresql
