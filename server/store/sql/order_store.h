#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/order_store.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Orders in a database, which must outlive this object.
class SqlOrderStore : public OrderStore {
 public:
  // True if this process carries out the orders, until the transaction ends.
  using IsOurs = std::function<bool(SqlConnection&)>;

  // Only a process that carries out the orders can save steps.
  explicit SqlOrderStore(
      SqlDatabase& database, IsOurs is_ours = [](SqlConnection&) { return true; })
      : database_(database), is_ours_(std::move(is_ours)) {}

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
  std::vector<std::string> blobs(const std::string& id) const override;
  void hurry(const std::string& id) override;
  CancelledOrder cancel(const Viewer& viewer, const std::string& id) override;
  Order retry(const Viewer& viewer, const std::string& id) override;
  OrderCounts counts() const override;
  std::size_t forget(Time before) override;

 private:
  std::vector<Order> list_after(const Viewer& viewer, const OrderFilter& filter,
                                const std::string& after, std::size_t limit) const;
  // The same from a table with damaged pages.
  std::vector<Order> undamaged_after(const Viewer& viewer, const OrderFilter& filter,
                                     const std::string& after, std::size_t limit) const;

  SqlDatabase& database_;
  const IsOurs is_ours_;
};

}  // namespace isomesh::store
