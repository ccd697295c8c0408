#pragma once

#include <string>
#include <vector>

#include "server/store/outbox.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Callbacks in the database of one process, which must outlive this object.
class SqlOutbox : public Outbox {
 public:
  explicit SqlOutbox(SqlDatabase& database) : database_(database) {}

  std::vector<Delivery> due(Time now, std::size_t per_receiver) const override;
  std::optional<Time> next_after(Time now) const override;
  void remove(const Delivery& delivery) override;
  void postpone(const Delivery& delivery, Time next) override;
  std::size_t count() const override;

 protected:
  // From a row that starts with job, url, body, attempts and created.
  Delivery delivery_of(const Rows& row) const;

 private:
  std::vector<Delivery> first_due(Time now, std::size_t per_receiver) const;
  // The same from a table with damaged pages, in any order.
  std::vector<Delivery> undamaged_due(Time now, std::size_t per_receiver) const;

  SqlDatabase& database_;
};

// Adds a callback for the end of a job or an order to the open transaction.
void add_callback(SqlConnection& connection, const std::string& id, const std::string& url,
                  const std::string& body);

}  // namespace isomesh::store
