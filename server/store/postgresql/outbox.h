#pragma once

#include <string>
#include <vector>

#include "server/store/postgresql/database.h"
#include "server/store/sql/outbox.h"

namespace isomesh::store::postgresql {

// Callbacks in a database that several processes share. A process that gets one to deliver has it
// reserved for some time. The database must outlive this object.
class PostgresOutbox : public SqlOutbox {
 public:
  explicit PostgresOutbox(Database& database) : SqlOutbox(database), database_(database) {}

  std::vector<Delivery> due(Time now, std::size_t per_receiver) const override;
  void postpone(const Delivery& delivery, Time next) override;

 private:
  Database& database_;
};

}  // namespace isomesh::store::postgresql
