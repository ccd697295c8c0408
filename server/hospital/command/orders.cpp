#include "server/hospital/command/orders.h"

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "client/cli/console.h"
#include "client/cli/exit_status.h"
#include "client/cli/ids.h"
#include "client/cli/option_values.h"
#include "client/cli/options.h"
#include "client/cli/text.h"
#include "proto/json_tree.h"
#include "server/hospital/client/orders.h"

namespace isomesh::cli {
namespace {

using Seconds = std::chrono::duration<double>;

struct OrderOptions {
  std::string pacs;
  std::string study;
  std::string series;
  std::string rule;
  std::string parameters;  // JSON
  std::vector<std::string> send;
  std::string label_volume;
  bool sends_nothing = false;
  std::optional<Priority> priority = {};
  bool does_not_wait = false;
};

struct ListOptions {
  std::string rule;
  std::optional<OrderState> state = {};
  bool cancels = false;
  bool retries = false;
};

struct SearchOptions {
  std::string pacs;  // empty: all are listed
  SeriesQuery query;
};

std::string in_seconds(Seconds time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", time.count());
  return text;
}

OrderRequest request_of(const OrderOptions& asked) {
  OrderRequest request;
  request.source = {.pacs = asked.pacs, .study = asked.study, .series = asked.series};
  if (!asked.rule.empty()) request.rule = asked.rule;
  if (!asked.parameters.empty()) request.parameters = asked.parameters;
  if (!asked.send.empty() || asked.sends_nothing) {
    request.send.emplace();
    for (const std::string& name : asked.send) request.send->push_back({.pacs = name});
  }
  if (!asked.label_volume.empty()) request.label_volume = asked.label_volume;
  if (asked.priority) request.priority = asked.priority;
  return request;
}

std::string reason_of(const Order& order) {
  return order.error ? ": " + order.error->detail : std::string();
}

// Prints one line for each step when it ends.
class StepTimes {
 public:
  void see(const Order& order) {
    if (order.state != state_) {
      const auto now = std::chrono::steady_clock::now();
      remark(std::string(to_string(state_)) + ' ' + in_seconds(now - began_));
      began_ = now;
      state_ = order.state;
    }
    if (order.attempts != attempts_ && order.error) {
      attempts_ = order.attempts;
      remark("attempt " + std::to_string(attempts_) + " failed" + reason_of(order));
    }
  }

 private:
  OrderState state_ = OrderState::kWaiting;
  std::uint32_t attempts_ = 0;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

std::string report_of(const Order& order) {
  std::string text = order.id + ' ' + std::string(to_string(order.state)) + reason_of(order) + '\n';
  const auto add = [&text](const std::string& line) { text += "  " + printable(line) + '\n'; };
  add("ordered " + order.created + " from " + order.source.pacs + ", study " + order.source.study +
      (order.rule ? ", rule " + *order.rule : ""));
  if (order.next_attempt) add("next attempt " + *order.next_attempt);
  for (const OrderResult& result : order.results) {
    add(result.pacs + (result.stored ? " has " : " lacks ") + result.sop_instance_uid + " (" +
        std::to_string(result.bytes) + " bytes)");
  }
  return text;
}

void show(const Order& order, bool json) {
  json ? print_json(to_json(order)) : print(report_of(order));
}

bool is_json_object(std::string_view text) {
  try {
    return json_values::is_object(JsonTree(text).root());
  } catch (const Error&) {
    return false;
  }
}

void add_order_options(CLI::App& app, Options& options, OrderOptions& order) {
  app.add_option("PACS", order.pacs, "Name of a PACS that the server knows")->required();
  app.add_option("STUDY", order.study, "Study Instance UID")->required();
  app.add_option("SERIES", order.series, "Series Instance UID")->required();
  app.add_option("--rule", order.rule,
                 "Rule on the server that supplies everything that is not given here");
  app.add_option("--parameters", order.parameters,
                 "Parameters of the mesh as a JSON object, as in POST /v1/jobs: '{\"iso\": 250}'")
      ->type_name("JSON")
      ->check([](const std::string& text) {
        return is_json_object(text) ? std::string() : std::string("must be a JSON object");
      });
  app.add_option("--send", order.send,
                 "PACS that receive the mesh, instead of those of the rule. May be repeated")
      ->type_name("PACS")
      ->allow_extra_args(false);
  app.add_flag("--send-nothing", order.sends_nothing, "Make the mesh, but send it nowhere")
      ->excludes("--send");
  app.add_option("--label-volume", order.label_volume,
                 "Id of an uploaded volume of labels on the grid of the series, such as the result "
                 "of an AI. It is meshed in place of the series")
      ->type_name("ID");
  add_name<Priority>(app, "--priority", "Priority of the order",
                     [&order](Priority priority) { order.priority = priority; });
  app.add_option("--key", options.key,
                 "Idempotency key: the same key returns the same order (default: a new key)")
      ->type_name("KEY");
  app.add_flag("--no-wait", order.does_not_wait, "Print the id of the order and exit");
}

void add_list_options(CLI::App& app, Options& options, ListOptions& order) {
  app.add_option("ORDER", options.id,
                 "Id of an order to show; its beginning or end is enough if unique")
      ->type_name("ID");
  add(app, "--state", "waiting|fetching|meshing|sending|succeeded|failed|cancelled",
      "Only orders in this state", [&order](const std::string& name) {
        order.state = from_string<OrderState>(name);
        if (!order.state) refuse("--state", "there is no state " + name);
      });
  app.add_option("--rule", order.rule, "Only orders of this rule");
  app.add_option("--cursor", options.cursor,
                 "Cursor of the page to show; the previous page prints it");
  auto* cancel = app.add_flag("--cancel", order.cancels, "Cancel this order")->needs("ORDER");
  app.add_flag("--retry", order.retries, "Retry this order if it has failed")
      ->needs("ORDER")
      ->excludes(cancel);
}

// Reports the time of each step.
int order(Client& server, const Options& options, const OrderOptions& asked) {
  OrderClient client(server);
  const Order accepted = client.submit(request_of(asked), options.key);
  if (asked.does_not_wait) {
    options.json ? print_json(to_json(accepted)) : print(accepted.id + '\n');
    return kDone;
  }
  StepTimes times;
  const Order ended = client.wait_for(accepted.id, [&times](const Order& now) { times.see(now); });
  show(ended, options.json);
  return ended.state == OrderState::kSucceeded ? kDone : kRefused;
}

std::vector<Candidate> candidates_of(const std::vector<Order>& orders) {
  std::vector<Candidate> all;
  for (const Order& order : orders) all.push_back({order.id, std::string(to_string(order.state))});
  return all;
}

int orders(Client& server, const Options& options, const ListOptions& asked) {
  OrderClient client(server);
  if (!options.id.empty()) {
    const std::string id =
        timed_id(options.id, "order", [&client] { return candidates_of(client.all()); });
    show(asked.cancels   ? client.cancel(id)
         : asked.retries ? client.retry(id)
                         : client.get(id),
         options.json);
    return kDone;
  }
  const OrderPage page = client.list(asked.state, asked.rule, options.cursor);
  if (options.json) {
    print_json(to_json(page.orders, page.next));
    return kDone;
  }
  for (const Order& each : page.orders) print(report_of(each));
  tell_next("isomesh orders", page.next);
  return kDone;
}

void add_search_options(CLI::App& app, SearchOptions& search) {
  SeriesQuery& query = search.query;
  app.add_option("PACS", search.pacs, "Name of a PACS to search for series, instead of the list");
  const auto add = [&app](const char* name, std::string& value, const char* help,
                          const char* type) {
    app.add_option(name, value, help)->type_name(type)->needs("PACS");
  };
  add("--patient-id", query.patient_id,
      "Patient ID; * stands for any text and ? for one character, as in the name", "ID");
  add("--patient-name", query.patient_name, "Name as DICOM writes it: 'Doe^Jane' or 'Doe*'",
      "NAME");
  add("--date", query.date, "Day of the study, or days: 20261130, 20261101-20261130 or 20261101-",
      "DAYS");
  add("--modality", query.modality, "Modality of the series, such as CT", "NAME");
  add("--study", query.study, "Study Instance UID", "UID");
  app.add_option("--limit", query.limit, "Most studies (default: 20, at most 100)")->needs("PACS");
}

int search(OrderClient& client, const Options& options, const SearchOptions& asked) {
  const PacsSeriesList found = client.search(asked.pacs, asked.query);
  if (options.json) {
    print_json(to_json(found));
    return kDone;
  }
  std::vector<std::vector<std::string>> rows = {
      {"DATE", "ID", "PATIENT", "MODALITY", "IMAGES", "STUDY", "SERIES", "UIDS"}};
  for (const PacsSeries& each : found.series) {
    rows.push_back({each.study_date, each.patient_id, each.patient_name, each.modality,
                    each.instances ? std::to_string(*each.instances) : "?", each.study_description,
                    each.series_description, each.study + ' ' + each.series});
  }
  if (!found.series.empty()) {
    std::vector<Align> columns(rows.front().size(), Align::kLeft);
    columns[4] = Align::kRight;
    print(in_columns(columns, std::move(rows)));
  }
  if (!found.complete) {
    remark("The PACS has more studies than were listed: narrow the search");
  } else if (found.series.empty()) {
    remark("The PACS has no such series");
  }
  return kDone;
}

int pacs(Client& client, const Options& options, const SearchOptions& asked) {
  if (!asked.pacs.empty()) {
    OrderClient orders(client);
    return search(orders, options, asked);
  }
  const std::vector<PacsStatus> all = OrderClient(client).pacs();
  if (options.json) {
    print_json(to_json(all));
    return kDone;
  }
  for (const PacsStatus& each : all) {
    std::string line = each.name + "  last success " + each.last_success.value_or("never");
    if (each.last_failure) {
      line += "  last failure " + *each.last_failure + " (" + each.reason.value_or("?") + ')';
    }
    print(printable(line) + '\n');
  }
  return kDone;
}

}  // namespace

Added order_commands() {
  const auto order_options = std::make_shared<OrderOptions>();
  const auto list_options = std::make_shared<ListOptions>();
  const auto search_options = std::make_shared<SearchOptions>();
  Added added;
  added.commands = {
      {.name = "order",
       .help = "Mesh a series from a PACS, send the mesh to a PACS, and wait",
       .examples = R"(  isomesh order archive 1.2.840.1 1.2.840.1.3 --rule ct-bone
  isomesh order archive 1.2.840.1 1.2.840.1.3 --parameters '{"iso": 250}' \
      --send viewer --no-wait
)",
       .add_options = [order_options](
                          CLI::App& app,
                          Options& options) { add_order_options(app, options, *order_options); },
       .run = [order_options](
                  Client& client,
                  const Options& options) { return order(client, options, *order_options); }},
      {.name = "orders",
       .help = "List orders; show, cancel or retry one",
       .examples = R"(  isomesh orders --state failed
  isomesh orders 0192e4b1-77c3 --retry
)",
       .add_options = [list_options](
                          CLI::App& app,
                          Options& options) { add_list_options(app, options, *list_options); },
       .run = [list_options](
                  Client& client,
                  const Options& options) { return orders(client, options, *list_options); }},
      {.name = "pacs",
       .help = "List the PACS that the server knows, or search one for series to order",
       .examples = R"(  isomesh pacs
  isomesh pacs main --patient-name 'Doe*' --date 20261101-20261130 --modality CT
)",
       .add_options = [search_options](
                          CLI::App& app,
                          Options& /*options*/) { add_search_options(app, *search_options); },
       .run = [search_options](
                  Client& client,
                  const Options& options) { return pacs(client, options, *search_options); }}};
  added.ids = {{.operand = "ORDER", .kind = "orders", .newest = [](Client& client) {
                  return candidates_of(OrderClient(client).list().orders);
                }}};
  return added;
}

}  // namespace isomesh::cli
