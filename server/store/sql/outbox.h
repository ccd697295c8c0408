#pragma once

#include <string>
#include <vector>

#include "server/store/outbox.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Callbacks in the database of one process, which must outlive it.
class SqlOutbox : public Outbox {
 public:
  explicit SqlOutbox(SqlDatabase& database) : database_(database) {}

  std::vector<Delivery> due(Time now, std::size_t per_receiver) const override;
  std::optional<Time> next_after(Time now) const override;
  void remove(const std::string& job) override;
  void postpone(const std::string& job, Time next) override;
  std::size_t count() const override;

 protected:
  // Of a row whose first columns are job, url, body, attempts and created.
  Delivery delivery_of(const Rows& row) const;

 private:
  SqlDatabase& database_;
};

// Has the end of anything delivered, under its id; part of the open transaction.
void add_callback(SqlConnection& connection, const std::string& id, const std::string& url,
                  const std::string& body);

}  // namespace isomesh::store
