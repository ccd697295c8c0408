#pragma once

#include "server/store/audit_trail.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {

// The audit trail in the database of a data folder, which must outlive it. Its table has triggers
// that let nobody change or remove a row.
class SqliteAuditTrail : public AuditTrail {
 public:
  explicit SqliteAuditTrail(Database& database) : database_(database) {}

  void add(const AuditEntry& entry) override;
  void read(std::uint64_t after,
            const std::function<void(std::string_view line)>& line) const override;
  std::uint64_t sent() const override;
  void note_sent(std::uint64_t number) override;

 private:
  Database& database_;
};

// Reads the trail of a data folder, also one that a daemon holds; see AuditTrail::read. Throws
// Error kNotFound when there is none.
void read_audit_trail(const std::filesystem::path& data, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

}  // namespace isomesh::store
