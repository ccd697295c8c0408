// Orders by the C++ client: meshes of a series in a PACS.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/isomesh/client.h"
#include "server/hospital/protocol/orders.h"

namespace isomesh {

using OrderProgress = std::function<void(const Order& order)>;

struct OrderPage {
  std::vector<Order> orders;
  std::string next;  // see JobPage
};

// The methods throw as those of `client` do, which must outlive this object, and are as thread
// safe.
class OrderClient {
 public:
  explicit OrderClient(Client& client) : client_(client) {}

  // Orders meshes of a series in a PACS. An equal key returns the same order.
  Order submit(const OrderRequest& request, const std::string& idempotency_key = {});
  // The order when it has ended, or its state after `wait` (whole seconds, limited to 30 by the
  // server).
  Order get(const std::string& id, std::chrono::seconds wait = std::chrono::seconds(0));
  // Returns the order in its final state. With a callback it is polled often at first, to report
  // short steps, and later once a second.
  Order wait_for(const std::string& id, const OrderProgress& progress = {});
  // One page of the orders, in that state and of that rule if given.
  OrderPage list(std::optional<OrderState> state = std::nullopt, const std::string& rule = {},
                 const std::string& cursor = {});
  std::vector<Order> all();
  Order cancel(const std::string& id);
  // Restarts a failed order. Throws kNotReady for one that has not failed.
  Order retry(const std::string& id);
  std::vector<PacsStatus> pacs();
  // Series of a PACS, the newest studies first. The query needs a patient, a date or a study.
  PacsSeriesList search(const std::string& pacs, const SeriesQuery& query);

 private:
  Client& client_;
};

}  // namespace isomesh
