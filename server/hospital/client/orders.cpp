#include "server/hospital/client/orders.h"

#include <algorithm>
#include <utility>

#include "base/ids.h"
#include "client/isomesh/pages.h"
#include "proto/json.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr const char* kOrders = "/v1/orders";
constexpr const char* kPacs = "/v1/pacs";
constexpr seconds kLongestWait{30};    // of one request
constexpr seconds kLongestSearch{30};  // of the server
// The minimum interval between requests, for a server that answers long polls immediately.
constexpr milliseconds kShortestLook{200};

}  // namespace

Order OrderClient::submit(const OrderRequest& request, const std::string& idempotency_key) {
  constexpr std::size_t kKeyBytes = 16;
  const std::string key = idempotency_key.empty() ? random_hex(kKeyBytes) : idempotency_key;
  return order_from_json(client_.ask(
      {.method = "POST", .path = {kOrders}, .json = to_json(request), .idempotency_key = key}));
}

Order OrderClient::get(const std::string& id, seconds wait) {
  RouteRequest request = {.path = {kOrders, id}, .patience = wait};
  if (wait.count() > 0) request.query.emplace_back("wait", std::to_string(wait.count()));
  return order_from_json(client_.ask(request));
}

Order OrderClient::wait_for(const std::string& id, const OrderProgress& progress) {
  // With a callback, ask often at first to report short steps, and later once a second.
  milliseconds pause = kShortestLook / 4;
  while (true) {
    const auto asked = std::chrono::steady_clock::now();
    Order current = get(id, progress ? seconds(0) : kLongestWait);
    if (progress) progress(current);
    if (is_final(current.state)) return current;
    const auto held =
        std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - asked);
    if (progress) {
      client_.pause(pause);
      pause = std::min<milliseconds>(pause + pause / 20, seconds(1));
    } else if (held < kShortestLook) {
      client_.pause(kShortestLook - held);
    }
  }
}

OrderPage OrderClient::list(std::optional<OrderState> state, const std::string& rule,
                            const std::string& cursor) {
  RouteRequest request = {.path = {kOrders}};
  if (state) request.query.emplace_back("state", to_string(*state));
  if (!rule.empty()) request.query.emplace_back("rule", rule);
  if (!cursor.empty()) request.query.emplace_back("cursor", cursor);
  const std::string body = client_.ask(request);
  return {.orders = orders_from_json(body), .next = next_from_json(body)};
}

std::vector<Order> OrderClient::all() {
  const auto ask = [this](const std::string& cursor) {
    RouteRequest request = {.path = {kOrders}};
    if (!cursor.empty()) request.query.emplace_back("cursor", cursor);
    return client_.ask(request);
  };
  return all_pages(ask, orders_from_json);
}

Order OrderClient::cancel(const std::string& id) {
  return order_from_json(client_.ask({.method = "DELETE", .path = {kOrders, id}}));
}

Order OrderClient::retry(const std::string& id) {
  return order_from_json(client_.ask({.method = "POST", .path = {kOrders, id, "retry"}}));
}

std::vector<PacsStatus> OrderClient::pacs() {
  return pacs_from_json(client_.ask({.path = {kPacs}}));
}

PacsSeriesList OrderClient::search(const std::string& pacs, const SeriesQuery& query) {
  RouteRequest request = {.path = {kPacs, pacs, "series"}, .patience = kLongestSearch};
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) request.query.emplace_back(name, value);
  };
  add("patient_id", query.patient_id);
  add("patient_name", query.patient_name);
  add("date", query.date);
  add("modality", query.modality);
  add("study", query.study);
  add("limit", std::to_string(query.limit));
  return pacs_series_from_json(client_.ask(request));
}

}  // namespace isomesh
