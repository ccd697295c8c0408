#include "server/hospital/routes.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "base/sha256.h"
#include "base/text.h"
#include "proto/dicom_uid.h"
#include "server/hospital/limits.h"
#include "server/hospital/protocol/orders.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/routes.h"

namespace isomesh::hospital {
namespace {

using namespace http;
using orders::Orders;

const std::string kOrders = "/v1/orders";
constexpr const char* kOrderCursor = "orders";

// Throws Error kNotFound if no PACS is configured.
Orders& configured(Orders* orders) {
  if (orders != nullptr) return *orders;
  throw Error(ErrorCode::kNotFound,
              "this daemon has no PACS: it was started without --hospital. If several share "
              "one database, send orders to the one that has it");
}

orders::Orderer orderer_of(const Request& request) {
  return {.name = owner_of(request), .is_administrator = !viewer_of(request)};
}

void submit(App& app, Orders* orders, const Request& request, Response& response) {
  check_known(request, {});
  Orders& all = configured(orders);
  const std::string body = json_body(app, request);
  const OrderRequest asked = parse_order_request(body);
  if (asked.callback) app.services.callback_targets.check(asked.callback->url);
  if (app.draining) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  const std::string key = idempotency_key_of(request);
  try {
    const auto [order, is_new] =
        all.submit(orderer_of(request), asked, key, key.empty() ? "" : sha256_of(body));
    response.set_header("Location", kOrders + '/' + order.id);
    answer_json(response, is_new ? 202 : 200, to_json(order));
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kUnavailable) {
      response.set_header("Retry-After",
                          std::to_string(hospital::limits::kRetryOrderAfter.count()));
    }
    throw;
  }
}

std::optional<Continuation> get(App& app, Orders* orders, const Request& request,
                                Response& response) {
  check_known(request, {"wait"});
  const auto wait = wait_of(request);
  Orders& all = configured(orders);
  const std::string id = request.path_parameter("id");
  const Order order = all.get(viewer_of(request), id);
  if (is_final(order.state) || wait.count() == 0 || app.stopping) {
    answer_tagged_json(request, response, to_json(order));
    return std::nullopt;
  }
  return Continuation{.job = id,
                      .until = std::chrono::steady_clock::now() + wait,
                      .resume = [&all, id](const Request& asked, Response& out) {
                        answer_tagged_json(asked, out, to_json(all.get(viewer_of(asked), id)));
                      }};
}

store::OrderFilter filter_of(const Request& request) {
  store::OrderFilter filter;
  if (request.has_parameter("state")) {
    filter.state = from_string<OrderState>(request.parameter("state"));
    if (!filter.state) {
      throw invalid_parameter("state",
                              "must be waiting, fetching, meshing, sending, succeeded, failed or "
                              "cancelled");
    }
  }
  if (request.has_parameter("rule")) filter.rule = std::string(request.parameter("rule"));
  return filter;
}

void list(Orders* orders, const Request& request, Response& response) {
  check_known(request, {"state", "rule", "cursor", "limit"});
  const Orders& all = configured(orders);
  const std::string after = id_after(request, kOrderCursor);
  const std::size_t limit = whole_number_of(request, "limit", kListLengths, kUsualListLength);
  answer_list<Order>(
      request, response,
      {.kind = kOrderCursor,
       .after = after,
       .limit = limit,
       .read = [&all, viewer = viewer_of(request), filter = filter_of(request)](
                   const std::string& from,
                   std::size_t count) { return all.list(viewer, filter, from, count); },
       .place_of = [](const Order& order) { return order.id; }});
}

void cancel(Orders* orders, const Request& request, Response& response) {
  check_known(request, {});
  Orders& all = configured(orders);
  const std::string id = request.path_parameter("id");
  if (request.has_header("If-Match")) {
    check_if_match(request, etag_of(to_json(all.get(viewer_of(request), id))));
  }
  answer_json(response, 200, to_json(all.cancel(viewer_of(request), id)));
}

void retry(Orders* orders, const Request& request, Response& response) {
  check_known(request, {});
  answer_json(response, 202,
              to_json(configured(orders).retry(viewer_of(request), request.path_parameter("id"))));
}

void pacs(Orders* orders, const Request& request, Response& response) {
  check_known(request, {});
  answer_json(response, 200, to_json(configured(orders).pacs()));
}

// The value of a parameter, without spaces around it; "" if it is missing.
std::string short_text_of(const Request& request, const std::string& name) {
  constexpr std::size_t kLongest = 200;
  const std::string value(trimmed(request.parameter(name)));
  // DICOM separates values by backslashes: this would be a search for several.
  if (value.size() > kLongest || has_control_characters(value) || value.find('\\') != value.npos) {
    throw invalid_parameter(name, "must be one value of at most 200 characters");
  }
  return value;
}

bool is_range_of_days(std::string_view text) {
  const auto is_day = [](std::string_view day) {
    constexpr std::size_t kDigits = 8;
    return day.size() == kDigits && is_digits(day);
  };
  const std::size_t dash = text.find('-');
  if (dash == text.npos) return is_day(text);
  const std::string_view first = text.substr(0, dash);
  const std::string_view last = text.substr(dash + 1);
  if (first.empty() || last.empty()) return is_day(first) || is_day(last);
  return is_day(first) && is_day(last) && first <= last;
}

bool is_modality(std::string_view text) {
  constexpr std::size_t kLongest = 16;
  return text.size() <= kLongest && std::ranges::all_of(text, [](char letter) {
           return (letter >= 'A' && letter <= 'Z') || (letter >= '0' && letter <= '9') ||
                  letter == '_';
         });
}

SeriesQuery series_query_of(const Request& request) {
  constexpr WholeNumbers kStudies = {1, 100};
  const SeriesQuery query = {
      .patient_id = short_text_of(request, "patient_id"),
      .patient_name = short_text_of(request, "patient_name"),
      .date = short_text_of(request, "date"),
      .modality = short_text_of(request, "modality"),
      .study = short_text_of(request, "study"),
      .limit = whole_number_of(request, "limit", kStudies, SeriesQuery().limit)};
  if (!query.date.empty() && !is_range_of_days(query.date)) {
    throw invalid_parameter("date",
                            "must be a day such as 20261130, or days in their order such as "
                            "20261101-20261130, 20261101- and -20261130");
  }
  if (!is_modality(query.modality)) {
    throw invalid_parameter("modality", "must be one such as CT, in capital letters");
  }
  if (!query.study.empty() && !is_uid(query.study)) {
    throw invalid_parameter("study", "must be a UID: digits and dots, at most 64");
  }
  return query;
}

void search_pacs(Orders* orders, const Request& request, Response& response) {
  check_known(request, {"patient_id", "patient_name", "date", "modality", "study", "limit"});
  Orders& all = configured(orders);
  const SeriesQuery query = series_query_of(request);
  try {
    answer_json(response, 200,
                to_json(all.search(orderer_of(request), request.path_parameter("name"), query)));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kPacsUnreachable) throw;
    // Clients repeat for minutes what a busy server refuses (503). A person waits for this.
    constexpr int kBadGateway = 502;
    Problem problem = to_problem(error, request.path);
    problem.status = kBadGateway;
    throw RecordedProblem(problem);
  }
}

}  // namespace

void add_order_routes(App& app, Orders* orders) {
  add_post(app, kOrders, [&app, orders](const auto& request, auto& response) {
    submit(app, orders, request, response);
  });
  add_computed_get(app, kOrders, [orders](const auto& request, auto& response) {
    list(orders, request, response);
  });
  add_get(app, kOrders + "/{id}", [&app, orders](const auto& request, auto& response) {
    return get(app, orders, request, response);
  });
  add_delete(app, kOrders + "/{id}",
             [orders](const auto& request, auto& response) { cancel(orders, request, response); });
  add_post(app, kOrders + "/{id}/retry",
           [orders](const auto& request, auto& response) { retry(orders, request, response); });
  add_get(app, "/v1/pacs",
          [orders](const auto& request, auto& response) { pacs(orders, request, response); });
  add_computed_get(app, "/v1/pacs/{name}/series", [orders](const auto& request, auto& response) {
    search_pacs(orders, request, response);
  });
}

}  // namespace isomesh::hospital
