// The audit trail of the service: who accessed which patient's images, when, from where and to
// where. Append-only.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/store/sql/sql.h"

namespace isomesh::store {

// Events of DICOM PS3.15, A.5, with their codes of the coding scheme DCM.
enum class AuditEvent {
  kStart,                  // 110120 Application Start
  kStop,                   // 110121 Application Stop
  kQuery,                  // 110112 Query
  kTransferred,            // 110104 DICOM Instances Transferred
  kAuthenticationFailure,  // 110114 User Authentication, failed
  kRestricted,             // 110113 Security Alert: a login that may not do this tried to
};

struct AuditEntry {
  AuditEvent event = AuditEvent::kStart;
  bool success = true;
  std::string order = {};      // empty: no order
  std::string owner = {};      // the order's owner
  std::string peer_name = {};  // as it is configured
  std::string direction = {};  // of a transfer: "in" or "out"
  std::string study = {};
  std::uint64_t instances = 0;
  std::string patient_id = {};
  std::string query = {};  // of a search; empty: for the study
  // The address of a peer that began an association, and the titles that it sent.
  std::string peer = {};
  std::string called = {};
  std::string calling = {};
  std::uint64_t unlisted = 0;  // rejected since the entry before, without entries of their own
  // Readings over HTTP, and refused logins there.
  std::string caller = {};  // the name of the token; empty without tokens
  std::string what = {};    // "volume", "labels", "slice", "mesh", ..., "login" or "permission"
  std::string volume = {};
  std::string job = {};        // of a mesh
  std::uint64_t requests = 0;  // that the entry stands for
};

// The stored form of an entry, and its form as a line.
std::string audit_record(const AuditEntry& entry);
std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record);

// The trail in a database, which must outlive this object. Triggers prevent changing, replacing or
// removing rows; digests detect it if it happens nevertheless. Thread safe. All methods may throw
// Error kOutOfSpace or kInternal.
class AuditTrail {
 public:
  explicit AuditTrail(SqlDatabase& database) : database_(database) {}

  void add(const AuditEntry& entry);

  // Calls `line` with each entry after number `after`, oldest first, as one JSON object without
  // line breaks.
  void read(std::uint64_t after, const std::function<void(std::string_view line)>& line) const;

  // The number of the last entry that a collector has received; 0 for none.
  std::uint64_t sent() const;
  void note_sent(std::uint64_t number);

 private:
  SqlDatabase& database_;
};

// The result of --verify.
struct AuditCheck {
  std::uint64_t entries = 0;                 // valid ones, up to the first invalid one
  std::uint64_t last = 0;                    // the number of the last valid one
  std::string digest = {};                   // the digest of that one
  std::optional<std::uint64_t> misfit = {};  // the number of the first invalid one
};

// A hash chain. The digest of an entry is the hex SHA-256 of the previous entry's digest (empty for
// the first), a line break and the entry's line. So changing, removing or inserting an entry
// requires changing all later digests.
class AuditChain {
 public:
  AuditChain() = default;
  explicit AuditChain(std::string digest) : digest_(std::move(digest)) {}

  void add(std::string_view line);
  const std::string& digest() const { return digest_; }

 private:
  std::string digest_;
};

// As AuditTrail::read(), on a connection.
void read_trail(SqlConnection& connection, std::uint64_t after,
                const std::function<void(std::string_view line)>& line);
// Reads every entry.
AuditCheck verify_trail(SqlConnection& connection);

}  // namespace isomesh::store
