#include "server/hospital/protocol/orders.h"

#include <array>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/dicom_uid.h"
#include "proto/fields.h"
#include "proto/json.h"
#include "proto/json_text.h"
#include "proto/json_values.h"
#include "proto/request_reader.h"

namespace isomesh {

// Fields as in proto/fields.h. Requests have rows, for request_reader.h.

void visit(Is<Geometry> auto& self, auto&& field) {
  field("origin", self.origin);
  field("spacing", self.spacing);
  field("direction", self.direction);
}

void visit(Is<OrderSource> auto& self, auto&& field) {
  field(Parameter{.name = "pacs", .is_required = true}, self.pacs);
  field(Parameter{.name = "study", .is_required = true}, self.study);
  field(Parameter{.name = "series", .is_required = true}, self.series);
  field(Parameter{.name = "instances"}, self.instances);
}

void visit(Is<SendTarget> auto& self, auto&& field) {
  field(Parameter{.name = "pacs", .is_required = true}, self.pacs);
  field(Parameter{.name = "format"}, self.format);
}

void visit(Is<OrderResult> auto& self, auto&& field) {
  field("pacs", self.pacs);
  field("format", self.format);
  field("label", self.label);
  field("sop_class_uid", self.sop_class_uid);
  field("series_uid", self.series_uid);
  field("sop_instance_uid", self.sop_instance_uid);
  field("bytes", self.bytes);
  field("stored", self.stored);
}

void visit(Is<Order> auto& self, auto&& field) {
  field("id", self.id);
  field("state", self.state);
  field("rule", self.rule);
  field("source", self.source);
  field("parameters", self.parameters);
  field("priority", self.priority);
  field("send", self.send);
  field("label_volume", self.label_volume);
  field("volume", self.volume);
  field("job", self.job);
  field("results", self.results);
  field("attempts", self.attempts);
  field("next_attempt", self.next_attempt);
  field("created", self.created);
  field("finished", self.finished);
  field("error", self.error);
}

// Omits `parameters`, which parse_order_parameters reads.
void visit(Is<OrderRequest> auto& self, auto&& field) {
  field(Parameter{.name = "source", .is_required = true}, self.source);
  field(Parameter{.name = "rule"}, self.rule);
  field(Parameter{.name = "send"}, self.send);
  field(Parameter{.name = "label_volume"}, self.label_volume);
  field(Parameter{.name = "priority"}, self.priority);
  field(Parameter{.name = "callback"}, self.callback);
}

void visit(Is<Workitem> auto& self, auto&& field) {
  field("worklist", self.worklist);
  field("uid", self.uid);
  field("procedure", self.procedure);
  field("transaction", self.transaction);
  field("claimed", self.claimed);
  field("told", self.told);
  field("ending", self.ending);
  field("patient_id", self.patient_id);
}

void visit(Is<OrderWork> auto& self, auto&& field) {
  field("listed", self.listed);
  field("listed_since", self.listed_since);
  field("failures", self.failures);
  field("looks", self.looks);
  field("begun", self.begun);
  field("identity", self.identity);
  field("blobs", self.blobs);
  field("label", self.label);
  field("series_number", self.series_number);
  field("callback", self.callback);
  field("max_error_mm", self.max_error_mm);
  field("triangles", self.triangles);
  field("queried", self.queried);
  field("sending", self.sending);
  field("confirmed", self.confirmed);
  field("failed_in", self.failed_in);
  field("contents", self.contents);
  field("workitem", self.workitem);
  field("segmented_series", self.segmented_series);
  field("image_geometry", self.image_geometry);
}

void visit(Is<PacsStatus> auto& self, auto&& field) {
  field("name", self.name);
  field("last_success", self.last_success);
  field("last_failure", self.last_failure);
  field("reason", self.reason);
}

void visit(Is<PacsSeries> auto& self, auto&& field) {
  field("study", self.study);
  field("series", self.series);
  field("patient_id", self.patient_id);
  field("patient_name", self.patient_name);
  field("study_date", self.study_date);
  field("study_description", self.study_description);
  field("series_description", self.series_description);
  field("modality", self.modality);
  field("instances", self.instances);
}

void visit(Is<PacsSeriesList> auto& self, auto&& field) {
  field("series", self.series);
  field("complete", self.complete);
}

template <>
constexpr bool kIsRequestObject<OrderSource> = true;
template <>
constexpr bool kIsRequestObject<SendTarget> = true;

namespace {

constexpr std::array kStates = {
    std::pair{OrderState::kWaiting, "waiting"},     std::pair{OrderState::kFetching, "fetching"},
    std::pair{OrderState::kMeshing, "meshing"},     std::pair{OrderState::kSending, "sending"},
    std::pair{OrderState::kSucceeded, "succeeded"}, std::pair{OrderState::kFailed, "failed"},
    std::pair{OrderState::kCancelled, "cancelled"}};

constexpr std::array kSendFormats = {
    std::pair{SendFormat::kStl, "stl"}, std::pair{SendFormat::kObj, "obj"},
    std::pair{SendFormat::kSr, "sr"}, std::pair{SendFormat::kSeg, "seg"}};

constexpr std::string_view kFormats = "formats";

Json object_of(std::string_view text, const std::string& what) {
  Json json = text.empty() ? Json::object() : parse_json<Json>(text, nullptr, false);
  if (!json.is_object()) throw Error(ErrorCode::kInvalidParameter, what + " must be a JSON object");
  return json;
}

// Checks that the members' types do not cover.
void check(const Json& json, const OrderRequest& request, RequestReader& reader) {
  for (const char* name : {"study", "series"}) {
    const Json::json_pointer place(std::string("/source/") + name);
    if (!json.contains(place) || !json[place].is_string()) continue;
    if (!is_uid(json[place].get<std::string>())) {
      reader.add(std::string("source.") + name,
                 "must be a UID: numbers separated by dots, at most 64 characters");
    }
  }
  if (json.contains(Json::json_pointer("/source/instances"))) {
    reader.add("source.instances", "is not a known member");
  }
  for (const char* name : {"parameters", "send"}) {
    if (!request.rule && !json.contains(name)) {
      reader.add(name, "is required unless rule is given");
    }
  }
}

}  // namespace

std::string_view to_string(OrderState value) {
  return kStates[static_cast<std::size_t>(value)].second;
}

template <>
std::optional<OrderState> from_string(std::string_view name) {
  for (const auto& [state, known] : kStates) {
    if (name == known) return state;
  }
  return std::nullopt;
}

bool is_final(OrderState state) {
  return state == OrderState::kSucceeded || state == OrderState::kFailed ||
         state == OrderState::kCancelled;
}

std::string_view to_string(SendFormat value) {
  return kSendFormats[static_cast<std::size_t>(value)].second;
}

template <>
std::optional<SendFormat> from_string(std::string_view name) {
  for (const auto& [format, known] : kSendFormats) {
    if (name == known) return format;
  }
  return std::nullopt;
}

template <>
std::string names_of<SendFormat>() {
  return R"("stl", "obj", "sr" or "seg")";
}

MeshFormat file_for(SendFormat format) {
  return format == SendFormat::kObj ? MeshFormat::kObj : MeshFormat::kStl;
}

std::string to_json(const Order& order) { return json_values::to_text(order); }

std::string to_json(const std::vector<Order>& orders, const std::string& next) {
  return json_values::page("orders", orders, next);
}

std::string to_json(const std::vector<PacsStatus>& pacs) {
  return json_values::object("pacs", pacs);
}

std::string to_json(const PacsSeriesList& found) { return json_values::to_text(found); }

std::string to_callback_json(const Order& order) {
  Json json;
  json_values::write_field(json, "id", order.id);
  json_values::write_field(json, "state", order.state);
  json_values::write_field(json, "rule", order.rule);
  json_values::write_field(json, "job", order.job);
  json_values::write_field(json, "created", order.created);
  json_values::write_field(json, "finished", order.finished);
  json["error"] = nullptr;
  // Omits the detail, which may describe the images.
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
  if (request.label_volume) json["label_volume"] = *request.label_volume;
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
PacsSeriesList pacs_series_from_json(std::string_view text) {
  return json_values::from_text<PacsSeriesList>(text);
}

std::string to_record(const Order& order) { return json_values::record_of(order); }
std::string to_record(const OrderWork& work) { return json_values::record_of(work); }
Order order_from_record(std::string_view text) { return json_values::from_record<Order>(text); }
OrderWork order_work_from_record(std::string_view text) {
  return json_values::from_record<OrderWork>(text);
}

OrderRequest parse_order_request(std::string_view body) {
  RequestReader reader;
  const Json json = request_body(body, reader);
  Json others = json;
  OrderRequest request;
  if (const auto parameters = others.find("parameters"); parameters != others.end()) {
    if (!parameters->is_object()) reader.add("parameters", "must be an object");
    request.parameters = dump(*parameters);
    others.erase(parameters);
  }
  reader.read_whole_object(others, request, "");
  check(json, request, reader);
  reader.throw_if_any();
  return request;
}

MeshParameters parse_order_parameters(std::string_view rules, std::string_view own,
                                      const std::string& prefix) {
  Json merged = object_of(rules, prefix + "parameters");
  const Json changes = object_of(own, prefix + "parameters");
  for (const auto& [name, value] : changes.items()) {
    // The order's own parameters decide between a job by labels and one at an iso-value.
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
