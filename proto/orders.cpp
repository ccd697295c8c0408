#include "proto/orders.h"

#include <array>
#include <set>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/json.h"
#include "proto/json_values.h"
#include "proto/order_fields.h"

namespace isomesh {
namespace {

constexpr std::array kStates = {
    std::pair{OrderState::kWaiting, "waiting"},     std::pair{OrderState::kFetching, "fetching"},
    std::pair{OrderState::kMeshing, "meshing"},     std::pair{OrderState::kSending, "sending"},
    std::pair{OrderState::kSucceeded, "succeeded"}, std::pair{OrderState::kFailed, "failed"},
    std::pair{OrderState::kCancelled, "cancelled"}};

constexpr std::string_view kFormats = "formats";

Json object_of(std::string_view text, const std::string& what) {
  Json json = text.empty() ? Json::object() : Json::parse(text, nullptr, false);
  if (!json.is_object()) throw Error(ErrorCode::kInvalidParameter, what + " must be a JSON object");
  return json;
}

// Collects what is wrong with a request.
class Faults {
 public:
  void add(const std::string& field, const std::string& message) {
    constexpr std::size_t kMost = 20;
    constexpr std::size_t kLongestName = 64;
    if (faults_.size() < kMost) faults_.push_back({field.substr(0, kLongestName), message});
  }

  void check_known(const Json& object, const std::string& prefix,
                   const std::set<std::string>& known) {
    for (const auto& [name, unused] : object.items()) {
      if (!known.contains(name)) add(prefix + name, "is not a known member");
    }
  }

  std::string text(const Json& object, const std::string& prefix, const char* name) {
    const auto found = object.find(name);
    if (found == object.end()) {
      add(prefix + name, "is required");
    } else if (!found->is_string()) {
      add(prefix + name, "must be a string");
    } else {
      return found->get<std::string>();
    }
    return "";
  }

  std::string uid(const Json& object, const std::string& prefix, const char* name) {
    std::string text = this->text(object, prefix, name);
    if (object.contains(name) && object[name].is_string() && !is_uid(text)) {
      add(prefix + name, "must be a UID: numbers separated by dots, at most 64 characters");
    }
    return text;
  }

  void throw_if_any() {
    if (!faults_.empty()) throw invalid_parameters(std::move(faults_));
  }

 private:
  std::vector<FieldError> faults_;
};

OrderSource read_source(const Json& body, Faults& faults) {
  const auto found = body.find("source");
  if (found == body.end() || !found->is_object()) {
    faults.add("source", "must be an object with pacs, study and series");
    return {};
  }
  faults.check_known(*found, "source.", {"pacs", "study", "series"});
  return {.pacs = faults.text(*found, "source.", "pacs"),
          .study = faults.uid(*found, "source.", "study"),
          .series = faults.uid(*found, "source.", "series")};
}

std::vector<SendTarget> read_targets(const Json& list, Faults& faults) {
  std::vector<SendTarget> targets;
  if (!list.is_array()) {
    faults.add("send", "must be a list of objects with pacs and format");
    return targets;
  }
  for (const Json& each : list) {
    if (!each.is_object()) {
      faults.add("send", "must be a list of objects with pacs and format");
      continue;
    }
    faults.check_known(each, "send.", {"pacs", "format"});
    targets.push_back({.pacs = faults.text(each, "send.", "pacs")});
    if (each.contains("format") && each["format"] != "stl") {
      faults.add("send.format", "must be \"stl\": no other format can be sent to a PACS");
    }
  }
  return targets;
}

std::optional<Priority> read_priority(const Json& json, Faults& faults) {
  const auto known =
      json.is_string() ? from_string<Priority>(json.get<std::string>()) : std::nullopt;
  if (!known) faults.add("priority", "must be " + names_of<Priority>());
  return known;
}

}  // namespace

bool is_final(OrderState state) {
  return state == OrderState::kSucceeded || state == OrderState::kFailed ||
         state == OrderState::kCancelled;
}

std::string_view to_string(OrderState value) {
  for (const auto& [state, name] : kStates) {
    if (state == value) return name;
  }
  return "";
}

template <>
std::optional<OrderState> from_string(std::string_view name) {
  for (const auto& [state, known] : kStates) {
    if (name == known) return state;
  }
  return std::nullopt;
}

bool is_uid(std::string_view text) {
  constexpr std::size_t kLongest = 64;
  return !text.empty() && text.size() <= kLongest &&
         text.find_first_not_of("0123456789.") == std::string_view::npos && text.front() != '.' &&
         text.back() != '.' && text.find("..") == std::string_view::npos;
}

std::string to_json(const Order& order) { return json_values::to_text(order); }

std::string to_json(const std::vector<Order>& orders, const std::string& next) {
  return json_values::page("orders", orders, next);
}

std::string to_json(const std::vector<PacsStatus>& pacs) {
  return json_values::object("pacs", pacs);
}

std::string to_callback_json(const Order& order) {
  Json json;
  json_values::write_field(json, "id", order.id);
  json_values::write_field(json, "state", order.state);
  json_values::write_field(json, "rule", order.rule);
  json_values::write_field(json, "job", order.job);
  json_values::write_field(json, "created", order.created);
  json_values::write_field(json, "finished", order.finished);
  json["error"] = nullptr;
  // The detail may tell of the images.
  if (order.error) {
    json["error"] = {{"type", order.error->type}, {"title", order.error->title}};
  }
  return dump(json);
}

std::string to_json(const OrderRequest& request) {
  Json json;
  json["source"] = {{"pacs", request.source.pacs},
                    {"study", request.source.study},
                    {"series", request.source.series}};
  if (request.rule) json["rule"] = *request.rule;
  if (request.parameters) json["parameters"] = object_of(*request.parameters, "parameters");
  if (request.send) json_values::write_field(json, "send", *request.send);
  if (request.priority) json_values::write_field(json, "priority", *request.priority);
  if (request.callback) json["callback"] = {{"url", request.callback->url}};
  return dump(json);
}

Order order_from_json(std::string_view text) { return json_values::from_text<Order>(text); }
std::vector<Order> orders_from_json(std::string_view text) {
  return json_values::from_text<std::vector<Order>>(text, "orders");
}
std::vector<PacsStatus> pacs_from_json(std::string_view text) {
  return json_values::from_text<std::vector<PacsStatus>>(text, "pacs");
}

std::string to_record(const OrderWork& work) { return json_values::to_text(work); }
Order order_from_record(std::string_view text) { return json_values::from_record<Order>(text); }
OrderWork order_work_from_record(std::string_view text) {
  return json_values::from_record<OrderWork>(text);
}

OrderRequest parse_order_request(std::string_view body) {
  const Json json = object_of(body.empty() ? "null" : body, "the body");
  Faults faults;
  faults.check_known(json, "", {"source", "rule", "parameters", "send", "priority", "callback"});
  OrderRequest request;
  request.source = read_source(json, faults);
  if (json.contains("rule")) request.rule = faults.text(json, "", "rule");
  if (json.contains("parameters")) {
    if (!json["parameters"].is_object()) faults.add("parameters", "must be an object");
    request.parameters = json["parameters"].dump();
  }
  if (json.contains("send")) request.send = read_targets(json["send"], faults);
  if (json.contains("priority")) request.priority = read_priority(json["priority"], faults);
  if (json.contains("callback")) {
    const Json& callback = json["callback"];
    if (!callback.is_object()) {
      faults.add("callback", "must be an object with url");
    } else {
      faults.check_known(callback, "callback.", {"url"});
      request.callback = Callback{faults.text(callback, "callback.", "url")};
    }
  }
  if (!request.rule && !request.parameters)
    faults.add("parameters", "is required unless rule is given");
  if (!request.rule && !request.send) faults.add("send", "is required unless rule is given");
  faults.throw_if_any();
  return request;
}

MeshParameters parse_order_parameters(std::string_view rules, std::string_view own,
                                      const std::string& prefix) {
  Json merged = object_of(rules, prefix + "parameters");
  const Json changes = object_of(own, prefix + "parameters");
  for (const auto& [name, value] : changes.items()) {
    // Of the two kinds of jobs the order's own is meant.
    if (name == "labels") merged.erase("iso");
    if (name == "iso") merged.erase("labels");
    merged[name] = value;
  }
  for (const char* name : {"volume", "priority", "callback"}) {
    if (merged.contains(name)) throw invalid_parameter(prefix + name, "is not a known member");
  }
  if (!merged.contains(kFormats)) merged[std::string(kFormats)] = {"stl"};
  merged["volume"] = "none";
  try {
    const JobParameters parameters = parse_job_parameters(merged.dump());
    if (parameters.space != Space::kLps) {
      throw invalid_parameter("space", "must be \"lps\", the space of the images");
    }
    return parameters;
  } catch (const Error& error) {
    std::vector<FieldError> faults = error.fields();
    for (FieldError& fault : faults) fault.field = prefix + fault.field;
    if (faults.empty()) throw;
    throw invalid_parameters(std::move(faults));
  }
}

}  // namespace isomesh
