#pragma once

#include <vector>

#include "server/store/outbox.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Callbacks in a database that several processes share, which must outlive it.
class PostgresOutbox : public Outbox {
 public:
  explicit PostgresOutbox(Database& database) : database_(database) {}

  std::vector<Delivery> due(Time now, std::size_t per_receiver) const override;
  std::optional<Time> next_after(Time now) const override;
  void remove(const std::string& job) override;
  void postpone(const std::string& job, Time next) override;
  std::size_t count() const override;

 private:
  Database& database_;
};

}  // namespace isomesh::store::postgresql
