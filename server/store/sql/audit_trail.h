#pragma once

#include "server/store/audit_trail.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// The audit trail in a database, which must outlive it. Its table has triggers that let nobody
// change, replace or remove a row, and digests that tell of one that was all the same.
class SqlAuditTrail : public AuditTrail {
 public:
  explicit SqlAuditTrail(SqlDatabase& database) : database_(database) {}

  void add(const AuditEntry& entry) override;
  void read(std::uint64_t after,
            const std::function<void(std::string_view line)>& line) const override;
  // Reads every entry. Throws as the others do.
  AuditCheck verify() const;
  std::uint64_t sent() const override;
  void note_sent(std::uint64_t number) override;

 private:
  SqlDatabase& database_;
};

// The same as verify() and read(), of a connection.
AuditCheck verify_audit_trail(SqlConnection& connection);
void read_audit_trail(SqlConnection& connection, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

}  // namespace isomesh::store
