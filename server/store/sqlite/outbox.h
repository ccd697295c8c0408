#pragma once

#include <string>
#include <vector>

#include "proto/types.h"
#include "server/store/outbox.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {

// Callbacks in the database of a data folder, which must outlive it.
class SqliteOutbox : public Outbox {
 public:
  explicit SqliteOutbox(Database& database) : database_(database) {}

  // Has the end of a job delivered, if the job has a callback; part of the open transaction.
  static void add(Connection& connection, const Job& job);
  // The same for anything that has ended, under its id.
  static void add(Connection& connection, const std::string& id, const std::string& url,
                  const std::string& body);

  std::vector<Delivery> due(Time now, std::size_t per_receiver) const override;
  std::optional<Time> next_after(Time now) const override;
  void remove(const std::string& job) override;
  void postpone(const std::string& job, Time next) override;
  std::size_t count() const override;

 private:
  Database& database_;
};

}  // namespace isomesh::store
