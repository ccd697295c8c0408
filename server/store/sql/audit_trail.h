#pragma once

#include <cstdint>

#include "server/store/audit_trail.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// The audit trail in a database, which must outlive this object. Triggers prevent changing,
// replacing or removing rows; digests detect it if it happens nevertheless.
class SqlAuditTrail : public AuditTrail {
 public:
  explicit SqlAuditTrail(SqlDatabase& database) : database_(database) {}

  void add(const AuditEntry& entry) override;
  void read(std::uint64_t after,
            const std::function<void(std::string_view line)>& line) const override;
  std::uint64_t sent() const override;
  void note_sent(std::uint64_t number) override;

 private:
  SqlDatabase& database_;
};

// Reads every entry.
AuditCheck verify_audit_trail(SqlConnection& connection);
// As read(), on a connection.
void read_audit_trail(SqlConnection& connection, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

}  // namespace isomesh::store
