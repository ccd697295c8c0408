#include "server/store/sql/audit_trail.h"

#include <vector>

#include "server/store/microseconds.h"

namespace isomesh::store {
namespace {

// A piece at a time, so that who reads slowly holds nobody up.
template <class Ask>
void read_pieces(const Ask& ask, std::uint64_t after,
                 const std::function<void(std::string_view line)>& line) {
  constexpr int kPiece = 500;
  while (true) {
    Rows rows =
        ask("SELECT id, at, record FROM audit WHERE id > ?1 ORDER BY id LIMIT ?2", after, kPiece);
    if (!rows.next()) return;
    do {
      after = rows.count(0);
      line(audit_line(after, rows.text(1), rows.text(2)));
    } while (rows.next());
  }
}

}  // namespace

// One at a time, so that nobody who reads after a number misses one that comes later. Asked again
// after a lost connection it may be there twice, which is better than not at all.
void SqlAuditTrail::add(const AuditEntry& entry) {
  const std::string record = audit_record(entry);
  database_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    transaction->lock_table("audit");
    std::int64_t number = 0;
    std::string at;
    {
      Rows row = transaction->query("SELECT coalesce(max(id), 0) + 1, isomesh_now() FROM audit");
      row.next();
      number = row.integer(0);
      at = timestamp_of(from_us(row.integer(1)));
    }
    transaction->run("INSERT INTO audit(id, at, record) VALUES(?1, ?2, ?3)", number, at, record);
    transaction.commit();
  });
}

void SqlAuditTrail::read(std::uint64_t after,
                         const std::function<void(std::string_view line)>& line) const {
  read_pieces([this](const char* sql, std::uint64_t from,
                     int most) { return database_.query(sql, from, most); },
              after, line);
}

std::uint64_t SqlAuditTrail::sent() const {
  Rows row = database_.query("SELECT id FROM audit_sent");
  row.next();
  return row.count(0);
}

void SqlAuditTrail::note_sent(std::uint64_t number) {
  database_.run(Change::kNeeded, "UPDATE audit_sent SET id = ?1", number);
}

void read_audit_trail(SqlConnection& connection, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line) {
  read_pieces([&](const char* sql, std::uint64_t from,
                  int most) { return connection.query(sql, from, most); },
              after, line);
}

}  // namespace isomesh::store
