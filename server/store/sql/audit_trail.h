#pragma once

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
  // Reads every entry. Throws as the other methods do.
  AuditCheck verify() const;
  std::uint64_t sent() const override;
  void note_sent(std::uint64_t number) override;

 private:
  SqlDatabase& database_;
};

// As verify() and read(), on a connection.
AuditCheck verify_audit_trail(SqlConnection& connection);
void read_audit_trail(SqlConnection& connection, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

}  // namespace isomesh::store
