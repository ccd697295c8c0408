#pragma once

#include <string>
#include <vector>

#include "server/store/order_store.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Orders in a database that several processes share, which must outlive it. One of them carries
// orders out; see Turn.
class PostgresOrderStore : public OrderStore {
 public:
  explicit PostgresOrderStore(Database& database) : database_(database) {}

  OrderSubmission submit(const OrderSpec& spec, std::size_t most_open) override;
  bool submit_watched(const OrderSpec& spec, const WatchedSeries& series,
                      std::size_t most_open) override;
  ReceivedFate submit_received(const OrderSpec& spec, const WatchedSeries& series, Time last,
                               std::size_t most_open) override;
  Order get(const Viewer& viewer, const std::string& id) const override;
  std::vector<Order> list(const Viewer& viewer, const OrderFilter& filter, const std::string& after,
                          std::size_t limit) const override;
  std::vector<OrderRecord> due(Time now, std::size_t limit) const override;
  std::optional<OrderRecord> if_due(const std::string& id, Time now) const override;
  std::optional<Time> next_after(Time now) const override;
  bool save(const OrderRecord& record, Time next) override;
  void hurry(const std::string& id) override;
  Order cancel(const Viewer& viewer, const std::string& id) override;
  Order retry(const Viewer& viewer, const std::string& id) override;
  OrderCounts counts() const override;
  std::size_t forget(Time before) override;

 private:
  // Writes the record of an order that is there, which is due at that time or else now.
  void write(Connection& connection, const OrderRecord& record, std::optional<Time> next) const;

  Database& database_;
};

}  // namespace isomesh::store::postgresql
