#include "server/hospital/records/workitem_store.h"

#include "server/store/microseconds.h"

namespace isomesh::store {
namespace {

constexpr const char* kWorkitemTable = "workitems";

constexpr const char* kWorkitemColumns =
    "SELECT uid, state, coalesce(\"transaction\", ''), record, created FROM workitems ";

WorkitemRecord workitem_of(const Rows& row) {
  return {.uid = row.text(0),
          .state = row.choice(1, WorkitemState::kCanceled),
          .transaction = row.text(2),
          .data = row.text(3)};
}

std::optional<WorkitemRecord> find_workitem(SqlConnection& connection, const std::string& uid,
                                            const char* lock = "") {
  Rows row = connection.query(std::string(kWorkitemColumns) + "WHERE uid = ?1" + lock, uid);
  if (!row.next()) return std::nullopt;
  return workitem_of(row);
}

}  // namespace

WorkitemStore::Added WorkitemStore::add(const WorkitemRecord& record,
                                        const WorkitemLimits& limits) {
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    connection.lock_table(kWorkitemTable);
    if (const auto known = find_workitem(connection, record.uid)) {
      return transaction.is_again() && *known == record ? Added::kNew : Added::kExists;
    }
    {
      Rows row = connection.query("SELECT count(*), coalesce(sum(bytes), 0) FROM workitems");
      row.next();
      if (row.count(0) >= limits.most || row.count(1) + record.data.size() > limits.most_bytes) {
        return Added::kFull;
      }
    }
    connection.run(
        "INSERT INTO workitems(uid, state, created, changed, bytes, record) VALUES(?1, ?2, "
        "isomesh_now(), isomesh_kept(isomesh_now()), ?3, ?4)",
        record.uid, record.state, record.data.size(), record.data);
    transaction.commit();
    return Added::kNew;
  });
}

std::optional<WorkitemRecord> WorkitemStore::find(const std::string& uid) const {
  return database_.read([&](SqlConnection& connection) { return find_workitem(connection, uid); });
}

bool WorkitemStore::change(const std::string& uid,
                           const std::function<void(WorkitemRecord&)>& change) {
  std::optional<WorkitemRecord> written;
  return database_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    auto record = find_workitem(connection, uid, connection.for_update());
    if (!record) return false;
    // The first attempt of this transaction may have succeeded.
    if (transaction.is_again() && written == record) return true;
    change(*record);
    written = record;
    const std::optional<std::string> secret =
        record->transaction.empty() ? std::nullopt : std::optional(record->transaction);
    connection.run(
        "UPDATE workitems SET state = ?1, \"transaction\" = ?2, bytes = ?3, record = ?4, changed = "
        "isomesh_kept(isomesh_now()) WHERE uid = ?5",
        record->state, secret, record->data.size(), record->data, uid);
    transaction.commit();
    return true;
  });
}

// In pieces, so that a slow reader blocks nobody.
void WorkitemStore::read(std::optional<WorkitemState> state,
                         const std::function<bool(const WorkitemRecord&)>& use) const {
  constexpr int kPiece = 50;
  std::int64_t created = -1;
  std::string uid;
  while (true) {
    Rows rows = database_.query(
        std::string(kWorkitemColumns) + (state ? "WHERE state = ?1" : "WHERE ?1 IS NULL") +
            " AND (created > ?2 OR (created = ?2 AND uid > ?3)) ORDER BY created, uid LIMIT ?4",
        state, created, uid, kPiece);
    int count = 0;
    for (; rows.next(); ++count) {
      const WorkitemRecord record = workitem_of(rows);
      created = rows.integer(4);
      uid = record.uid;
      if (!use(record)) return;
    }
    if (count < kPiece) return;
  }
}

std::size_t WorkitemStore::forget(Time before) {
  return database_.run(Change::kNeeded, "DELETE FROM workitems WHERE changed < ?1",
                       database_.to_us(before));
}

}  // namespace isomesh::store
