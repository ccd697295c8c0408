#include "server/store/audit/trail.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/sha256.h"
#include "proto/json_tree.h"
#include "server/store/microseconds.h"

namespace isomesh::store {
namespace {

struct Code {
  const char* value;
  const char* meaning;
};

Code code_of(AuditEvent event) {
  switch (event) {
    case AuditEvent::kStart:
      return {"110120", "Application Start"};
    case AuditEvent::kStop:
      return {"110121", "Application Stop"};
    case AuditEvent::kQuery:
      return {"110112", "Query"};
    case AuditEvent::kTransferred:
      return {"110104", "DICOM Instances Transferred"};
    case AuditEvent::kAuthenticationFailure:
      return {"110114", "User Authentication"};
    case AuditEvent::kRestricted:
      return {"110113", "Security Alert"};
  }
  return {"", ""};
}

}  // namespace

std::string audit_record(const AuditEntry& entry) {
  const Code code = code_of(entry.event);
  JsonTree json;
  const auto put = [&](const char* name, std::string_view text) {
    json_values::assign(json_values::member(json.root(), name), text);
  };
  put("event", code.value);
  put("meaning", code.meaning);
  put("outcome", entry.success ? "success" : "failure");
  for (const auto& [name, text] :
       {std::pair{"order", &entry.order}, std::pair{"owner", &entry.owner},
        std::pair{"pacs", &entry.peer_name}, std::pair{"direction", &entry.direction},
        std::pair{"study", &entry.study}, std::pair{"patient_id", &entry.patient_id},
        std::pair{"query", &entry.query}, std::pair{"peer", &entry.peer},
        std::pair{"called", &entry.called}, std::pair{"calling", &entry.calling},
        std::pair{"caller", &entry.caller}, std::pair{"what", &entry.what},
        std::pair{"volume", &entry.volume}, std::pair{"job", &entry.job}}) {
    if (!text->empty()) put(name, *text);
  }
  const auto count = [&](const char* name, std::uint64_t number) {
    json_values::assign(json_values::member(json.root(), name), number);
  };
  if (entry.event == AuditEvent::kTransferred && entry.requests == 0) {
    count("instances", entry.instances);
  }
  if (entry.unlisted > 0) count("unlisted", entry.unlisted);
  if (entry.requests > 0) count("requests", entry.requests);
  return dump(json.root());
}

std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record) {
  // The record is appended after these two.
  JsonTree head;
  json_values::assign(json_values::member(head.root(), "id"), number);
  json_values::assign(json_values::member(head.root(), "at"), std::string_view(at));
  std::string text = dump(head.root());
  // Damage may have emptied it. The line is not JSON then, as with other damage.
  text.back() = ',';
  return text.append(record, std::min<std::size_t>(1, record.size()));
}

namespace {

struct Entry {
  std::uint64_t number = 0;
  std::string line;
  std::string chain;
};

// Calls `take` for the entries after `after`, oldest first, while it returns true. Reads in pieces,
// so that a slow reader blocks nobody.
template <class Ask, class Take>
void read_pieces(const Ask& ask, std::uint64_t after, const Take& take) {
  constexpr int kPiece = 500;
  while (true) {
    Rows rows = ask("SELECT id, at, record, chain FROM audit WHERE id > ?1 ORDER BY id LIMIT ?2",
                    after, kPiece);
    if (!rows.next()) return;
    do {
      after = rows.count(0);
      if (!take(Entry{after, audit_line(after, rows.text(1), rows.text(2)), rows.text(3)})) return;
    } while (rows.next());
  }
}

// The chain over all entries so far.
AuditChain chain_of(SqlConnection& connection) {
  Rows last = connection.query("SELECT chain FROM audit ORDER BY id DESC LIMIT 1");
  return last.next() ? AuditChain(last.text(0)) : AuditChain();
}

}  // namespace

void AuditChain::add(std::string_view line) {
  digest_ += '\n';
  digest_ = sha256_of(digest_.append(line));
}

// Locks the table, so that numbers become visible in order and no reader misses an entry. If the
// connection is lost, a repetition may add the entry twice; that is better than losing it.
void AuditTrail::add(const AuditEntry& entry) {
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
    AuditChain chain = chain_of(transaction.connection());
    chain.add(audit_line(static_cast<std::uint64_t>(number), at, record));
    transaction->run("INSERT INTO audit(id, at, record, chain) VALUES(?1, ?2, ?3, ?4)", number, at,
                     record, chain.digest());
    transaction.commit();
  });
}

void AuditTrail::read(std::uint64_t after,
                      const std::function<void(std::string_view line)>& line) const {
  read_pieces([this](const char* sql, std::uint64_t from,
                     int most) { return database_.query(sql, from, most); },
              after,
              [&](const Entry& entry) {
                line(entry.line);
                return true;
              });
}

std::uint64_t AuditTrail::sent() const {
  Rows row = database_.query("SELECT id FROM audit_sent");
  row.next();
  return row.count(0);
}

void AuditTrail::note_sent(std::uint64_t number) {
  database_.run(Change::kNeeded, "UPDATE audit_sent SET id = ?1", number);
}

void read_trail(SqlConnection& connection, std::uint64_t after,
                const std::function<void(std::string_view line)>& line) {
  read_pieces([&](const char* sql, std::uint64_t from,
                  int most) { return connection.query(sql, from, most); },
              after,
              [&](const Entry& entry) {
                line(entry.line);
                return true;
              });
}

AuditCheck verify_trail(SqlConnection& connection) {
  AuditCheck result;
  AuditChain chain;
  const auto ask = [&](const char* sql, std::uint64_t from, int most) {
    return connection.query(sql, from, most);
  };
  read_pieces(ask, 0, [&](const Entry& entry) {
    chain.add(entry.line);
    if (entry.chain != chain.digest()) {
      result.misfit = entry.number;
      return false;
    }
    ++result.entries;
    result.last = entry.number;
    result.digest = chain.digest();
    return true;
  });
  return result;
}

}  // namespace isomesh::store
