#include "server/store/postgresql/audit_trail.h"

namespace isomesh::store::postgresql {

// One at a time, so that nobody who reads after a number misses one that comes later. Asked again
// after a lost connection it may be there twice, which is better than not at all.
void PostgresAuditTrail::add(const AuditEntry& entry) {
  const std::string record = audit_record(entry);
  database_.ask([&](Connection& connection, bool) {
    Transaction transaction(connection);
    transaction->run("LOCK TABLE audit IN SHARE ROW EXCLUSIVE MODE");
    transaction->run(
        "INSERT INTO audit SELECT coalesce(max(id), 0) + 1, to_char(clock_timestamp() AT TIME ZONE "
        "'UTC', 'YYYY-MM-DD\"T\"HH24:MI:SS.MS\"Z\"'), $1::text FROM audit",
        record);
    transaction.commit();
  });
}

// A piece at a time, so that who reads slowly holds nobody up.
void PostgresAuditTrail::read(std::uint64_t after,
                              const std::function<void(std::string_view line)>& line) const {
  constexpr int kPiece = 500;
  while (true) {
    Rows rows = database_.run(
        "SELECT id, at, record FROM audit WHERE id > $1::bigint ORDER BY id LIMIT $2::int", after,
        kPiece);
    if (rows.count() == 0) return;
    while (rows.next()) {
      after = static_cast<std::uint64_t>(rows.integer(0));
      line(audit_line(after, rows.text(1), rows.text(2)));
    }
  }
}

std::uint64_t PostgresAuditTrail::sent() const {
  Rows row = database_.run("SELECT id FROM audit_sent");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

void PostgresAuditTrail::note_sent(std::uint64_t number) {
  database_.run("UPDATE audit_sent SET id = $1::bigint", number);
}

}  // namespace isomesh::store::postgresql
