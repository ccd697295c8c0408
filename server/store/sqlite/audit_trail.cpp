#include "server/store/sqlite/audit_trail.h"

#include "base/clock.h"
#include "proto/error.h"

namespace isomesh::store {
namespace {

// A piece at a time, so that who reads slowly holds nobody up.
template <class Read>
void read_pieces(const Read& open, std::uint64_t after,
                 const std::function<void(std::string_view line)>& line) {
  constexpr int kPiece = 500;
  while (true) {
    std::vector<std::string> lines;
    {
      const auto reading = open();
      Query rows = reading->query(
          "SELECT id, at, record FROM audit WHERE id > ? ORDER BY id LIMIT ?", after, kPiece);
      while (rows.next()) {
        after = static_cast<std::uint64_t>(rows.integer(0));
        lines.push_back(audit_line(after, rows.text(1), rows.text(2)));
      }
    }
    if (lines.empty()) return;
    for (const std::string& each : lines) line(each);
  }
}

}  // namespace

void SqliteAuditTrail::add(const AuditEntry& entry) {
  database_.freeing([&] {
    Transaction transaction(database_.writer());
    transaction->run("INSERT INTO audit(at, record) VALUES(?, ?)", timestamp(),
                     audit_record(entry));
    transaction.commit();
  });
}

void SqliteAuditTrail::read(std::uint64_t after,
                            const std::function<void(std::string_view line)>& line) const {
  read_pieces([this] { return Reading(database_.reader()); }, after, line);
}

std::uint64_t SqliteAuditTrail::sent() const {
  const Reading reading(database_.reader());
  Query row = reading->query("SELECT id FROM audit_sent");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

void SqliteAuditTrail::note_sent(std::uint64_t number) {
  database_.freeing([&] {
    Transaction transaction(database_.writer());
    transaction->run("UPDATE audit_sent SET id = ?", number);
    transaction.commit();
  });
}

void read_audit_trail(const std::filesystem::path& data, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line) {
  const std::filesystem::path file = data / "isomesh.sqlite";
  if (!std::filesystem::exists(file)) {
    throw Error(ErrorCode::kNotFound, "the data folder has no data of isomeshd");
  }
  Connection connection(file, Connection::Mode::kRead);
  read_pieces([&] { return Reading(connection); }, after, line);
}

}  // namespace isomesh::store
