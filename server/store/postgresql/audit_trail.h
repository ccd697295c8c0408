#pragma once

#include "server/store/audit_trail.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// The audit trail in a database that several processes share, which must outlive it. Its table has
// a trigger that lets nobody change or remove a row.
class PostgresAuditTrail : public AuditTrail {
 public:
  explicit PostgresAuditTrail(Database& database) : database_(database) {}

  void add(const AuditEntry& entry) override;
  void read(std::uint64_t after,
            const std::function<void(std::string_view line)>& line) const override;
  std::uint64_t sent() const override;
  void note_sent(std::uint64_t number) override;

 private:
  Database& database_;
};

}  // namespace isomesh::store::postgresql
