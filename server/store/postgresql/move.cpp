#include "server/store/postgresql/move.h"

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/store/files/blob_store.h"
#include "server/store/job_rules.h"
#include "server/store/outbox.h"
#include "server/store/postgresql/database.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store::postgresql {
namespace {

using Source = store::Connection;

constexpr std::chrono::hours kLongestMove{24};

// A table in SQLite and the columns in PostgreSQL that receive its rows.
struct Table {
  std::string columns;  // with the table's name
  std::string rows;
  int count;
};

// Events are not copied: their numbers have another form, and nobody waits for them.
const std::array kAsTheyAre = {
    Table{"volumes(owner, id, created, used, blob, bytes, record, labelled)",
          "SELECT owner, id, created, used, blob, bytes, record, labelled FROM volumes", 8},
    Table{"meshes(job, blob, bytes)", "SELECT job, blob, bytes FROM meshes", 3},
    Table{"callbacks(job, receiver, url, body, attempts, created, next)",
          "SELECT job, receiver, url, body, attempts, created, next FROM callbacks", 7},
    Table{"expired(id, owner, at)", "SELECT id, owner, at FROM expired", 3},
    Table{"audit(id, at, record, chain)", "SELECT id, at, record, chain FROM audit ORDER BY id",
          4}};

// The values of a row, converted for the columns.
class Values {
 public:
  Values(const Rows& row, int count) {
    texts_.reserve(static_cast<std::size_t>(count) + 2);
    for (int column = 0; column < count; ++column) {
      add(row.is_null(column) ? std::nullopt : std::optional(row.text(column)));
    }
  }

  void add(std::optional<std::string> value) { texts_.push_back(std::move(value)); }

  std::vector<Parameter> parameters() const {
    std::vector<Parameter> all;
    for (const auto& text : texts_) {
      all.emplace_back(text ? std::string_view(*text) : std::string_view(),
                       Parameter::Type::kOfColumn);
      all.back().is_null = !text;
    }
    return all;
  }

 private:
  std::vector<std::optional<std::string>> texts_;
};

std::string insertion(const Table& table) {
  std::string sql = "INSERT INTO " + table.columns + " VALUES(";
  for (int n = 1; n <= table.count; ++n) sql += (n > 1 ? ", ?" : "?") + std::to_string(n);
  return sql + ')';
}

std::uint64_t copy(Source& from, Connection& to, const Table& table) {
  const std::string sql = insertion(table);
  std::uint64_t count = 0;
  Rows rows = from.query(table.rows);
  for (; rows.next(); ++count) to.tell(sql, Values(rows, table.count).parameters());
  return count;
}

// Tables of components have the same columns in both databases.
std::uint64_t copy_as_it_is(Source& from, Connection& to, const std::string& table) {
  Rows columns = from.query("SELECT count(*) FROM pragma_table_info(?1)", table);
  columns.next();
  const int count = static_cast<int>(columns.integer(0));
  return copy(from, to, {.columns = table, .rows = "SELECT * FROM " + table, .count = count});
}

// Ordered by id, that is, by age.
std::uint64_t copy_jobs(Source& from, Connection& to) {
  const Table kTable = {
      "jobs(id, owner, state, priority, volume, result_key, accepted, finished, not_before, "
      "attempts, fence, waiting_for, idempotency_key, request_digest, record, cost, version, "
      "receiver, url)",
      "SELECT id, owner, state, priority, volume, result_key, accepted, finished, not_before, "
      "attempts, fence, waiting_for, idempotency_key, request_digest, record, cost, 1 "
      "FROM jobs ORDER BY id",
      19};
  const std::string sql = insertion(kTable);
  std::uint64_t count = 0;
  Rows rows = from.query(kTable.rows);
  for (; rows.next(); ++count) {
    Values values(rows, 17);
    // A damaged record is copied as it is, and its job fails there.
    const auto job = readable_job(rows.text(14), rows.text(0));
    const auto callback = job ? job->parameters.callback : std::nullopt;
    values.add(callback ? std::optional(receiver_of(callback->url)) : std::nullopt);
    values.add(callback ? std::optional(callback->url) : std::nullopt);
    to.tell(sql, values.parameters());
  }
  return count;
}

// The name in the mark of the folder's blobs, which the database gets too.
std::string name_of_blobs(store::Database& source) {
  const store::Reading reading(source.writer());
  Rows row = reading->query("SELECT id FROM identity");
  return row.next() ? row.text(0) : random_hex(16);
}

void refuse_used(Transaction& transaction, const std::vector<std::string>& tables) {
  std::string all;
  std::string rows;
  for (const std::string& table : tables) {
    all += (all.empty() ? "" : ", ") + table;
    rows += (rows.empty() ? "" : " UNION ALL ") + ("SELECT 1 FROM " + table);
  }
  transaction->script("LOCK TABLE identity, " + all + " IN EXCLUSIVE MODE");
  if (!transaction->query(rows + " LIMIT 1").next()) return;
  throw Error(ErrorCode::kInvalidParameter, "the database already has records: name an empty one");
}

// Copies all records to a database without records. The blobs belong to the database by that name.
Moved copy_records(store::Database& source, const std::string& url, const std::string& name,
                   const std::vector<Schema>& components) {
  const store::Reading reading(source.writer());
  Database target(
      {.url = url, .node = "move " + random_hex(8), .connections = 1, .components = components});
  return target.ask_for(kLongestMove, [&](Connection& to, bool) {
    Transaction transaction(to);
    std::vector<std::string> unused = {"volumes", "jobs", "audit"};
    for (const Schema& schema : components) {
      unused.insert(unused.end(), schema.tables.begin(), schema.tables.end());
    }
    refuse_used(transaction, unused);
    Moved moved;
    moved.jobs = copy_jobs(reading.connection(), to);
    for (const Table& table : kAsTheyAre) {
      const std::uint64_t count = copy(reading.connection(), to, table);
      if (table.columns.starts_with("volumes(")) moved.volumes = count;
    }
    for (const Schema& schema : components) {
      for (const std::string& table : schema.tables) {
        const std::uint64_t count = copy_as_it_is(reading.connection(), to, table);
        if (table == schema.tables.front()) moved.others[table] = count;
      }
    }
    {
      Rows row = reading->query("SELECT id FROM audit_sent");
      row.next();
      transaction->query("UPDATE audit_sent SET id = ?1", row.integer(0));
    }
    {
      Rows row = reading->query("SELECT key FROM volume_key");
      row.next();
      transaction->query("UPDATE volume_key SET key = ?1", row.text(0));
    }
    transaction->query("DELETE FROM identity");
    transaction->query("INSERT INTO identity VALUES(?1, isomesh_now())", name);
    transaction.commit();
    return moved;
  });
}

// The copy is complete by now, so an error does not undo it.
void retire(store::Database& source, const std::string& name) {
  try {
    mark_as_moved(source, name);
  } catch (const Error& error) {
    log_error("the old records could not be marked as moved. Never start without --store again: {}",
              error.what());
  }
}

}  // namespace

Moved move_records(const DataFolder& folder, const std::string& url,
                   const std::vector<Schema>& components) {
  if (!std::filesystem::exists(folder.records())) {
    throw Error(ErrorCode::kInvalidParameter, "the data folder has no records to move");
  }
  store::Database source(folder, components);
  // Nobody runs these jobs any more. They are queued again, here as in the copy.
  FileBlobStore blobs(folder);
  SqliteJobStore(source, blobs, {}).reap();
  const std::string name = name_of_blobs(source);
  const Moved moved = copy_records(source, url, name, components);
  retire(source, name);
  return moved;
}

}  // namespace isomesh::store::postgresql
