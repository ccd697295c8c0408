#include "proto/orders.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/ids.h"
#include "client/isomesh/impl.h"
#include "client/isomesh/url.h"
#include "proto/json.h"

namespace isomesh {
namespace {

using std::chrono::seconds;

const std::string kOrders = "/v1/orders";

std::string path_of(const std::string& id) { return kOrders + '/' + path_segment(id); }

}  // namespace

Order Client::submit_order(const OrderRequest& request, const std::string& idempotency_key) {
  const std::string key = idempotency_key.empty() ? random_hex(kKeyBytes) : idempotency_key;
  return order_from_json(
      impl_->repeat({.method = "POST",
                     .target = kOrders,
                     .headers = {{"Content-Type", "application/json"}, {"Idempotency-Key", key}},
                     .body = to_json(request)}));
}

Order Client::order(const std::string& id, seconds wait) {
  const std::string query =
      wait.count() > 0 ? query_string({{"wait", std::to_string(wait.count())}}) : "";
  return order_from_json(impl_->repeat({.target = path_of(id) + query, .patience = wait}));
}

Order Client::wait_for_order(const std::string& id, const OrderProgress& progress) {
  using std::chrono::milliseconds;
  // With a callback, poll often at first to report short steps, and later once a second.
  milliseconds pause = kShortestLook / 4;
  while (true) {
    const auto asked = std::chrono::steady_clock::now();
    Order current = order(id, progress ? seconds(0) : kLongestWait);
    if (progress) progress(current);
    if (is_final(current.state)) return current;
    const auto held =
        std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - asked);
    if (progress) {
      impl_->pause(pause);
      pause = std::min<milliseconds>(pause + pause / 20, seconds(1));
    } else if (held < kShortestLook) {
      impl_->pause(kShortestLook - held);
    }
  }
}

OrderPage Client::orders(std::optional<OrderState> state, const std::string& rule,
                         const std::string& cursor) {
  Query query;
  if (state) query.emplace_back("state", to_string(*state));
  if (!rule.empty()) query.emplace_back("rule", rule);
  if (!cursor.empty()) query.emplace_back("cursor", cursor);
  const std::string body = impl_->repeat({.target = kOrders + query_string(query)});
  return {.orders = orders_from_json(body), .next = next_from_json(body)};
}

Order Client::cancel_order(const std::string& id) {
  return order_from_json(impl_->send({.method = "DELETE", .target = path_of(id)}));
}

Order Client::retry_order(const std::string& id) {
  return order_from_json(impl_->send({.method = "POST", .target = path_of(id) + "/retry"}));
}

std::vector<PacsStatus> Client::pacs() {
  return pacs_from_json(impl_->repeat({.target = "/v1/pacs"}));
}

}  // namespace isomesh
