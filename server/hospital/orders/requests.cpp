#include "server/hospital/orders/requests.h"

#include <algorithm>
#include <string_view>

#include "base/clock.h"
#include "base/ids.h"
#include "proto/error.h"

namespace isomesh::orders {
namespace {

constexpr const char* kLabel = "Surface";
constexpr std::int64_t kSeriesNumber = 9000;

const Rule* rule_of(const HospitalSettings& settings, const Orderer& orderer,
                    const OrderRequest& request) {
  if (!request.rule) return nullptr;
  const Rule* rule = settings.find_rule(*request.rule);
  if (rule == nullptr) throw invalid_parameter("rule", "is not configured");
  if (!orderer.is_administrator && rule->owner != orderer.name) {
    throw Error(ErrorCode::kForbidden, "the rule belongs to another owner");
  }
  return rule;
}

// A request contains names of PACS, never addresses.
const PacsSettings& pacs_of(const HospitalSettings& settings, const std::string& name,
                            std::string_view field) {
  const PacsSettings* pacs = settings.find_pacs(name);
  if (pacs == nullptr) throw invalid_parameter(std::string(field), "is not configured");
  return *pacs;
}

bool may_use(const PacsSettings& pacs, const Orderer& orderer) {
  return orderer.is_administrator || pacs.owners.empty() ||
         std::ranges::find(pacs.owners, orderer.name) != pacs.owners.end();
}

void check_owner(const PacsSettings& pacs, const Orderer& orderer) {
  if (may_use(pacs, orderer)) return;
  throw Error(ErrorCode::kForbidden, "this PACS can be used only by a rule");
}

// Requests the files from which the objects are made.
void add_sent_files(Order& order) {
  std::vector<MeshFormat>& formats = order.parameters.formats;
  for (const SendTarget& target : order.send) {
    const MeshFormat file = file_for(target.format);
    if (std::ranges::find(formats, file) == formats.end()) formats.push_back(file);
  }
}

void check_labels(const Order& order) {
  if (order.label_volume && !order.parameters.labels) {
    throw invalid_parameter("parameters.labels", "is required with label_volume");
  }
  const bool is_segmented =
      std::ranges::find(order.send, SendFormat::kSeg, &SendTarget::format) != order.send.end();
  if (is_segmented && !order.label_volume) {
    throw invalid_parameter("label_volume", "is required to send the format \"seg\"");
  }
}

store::OrderRecord new_record() {
  store::OrderRecord record;
  record.order.id = time_ordered_id();
  record.order.created = timestamp();
  record.work.begun = record.order.created;
  return record;
}

}  // namespace

store::OrderRecord make_order(const HospitalSettings& settings, const Orderer& orderer,
                              const OrderRequest& request) {
  const Rule* rule = rule_of(settings, orderer, request);
  store::OrderRecord record = new_record();
  Order& order = record.order;
  order.rule = request.rule;
  order.source = request.source;
  const PacsSettings& source = pacs_of(settings, request.source.pacs, "source.pacs");
  order.parameters = parse_order_parameters(rule == nullptr ? "" : rule->parameters,
                                            request.parameters.value_or(""), "parameters.");
  order.priority = request.priority.value_or(Priority::kRoutine);
  if (request.send) {
    order.send = *request.send;
  } else if (rule != nullptr) {
    order.send = rule->send;
  }
  if (source.dicomweb.empty()) {
    throw invalid_parameter("source.pacs", "is a PACS to which meshes are only sent");
  }
  if (rule == nullptr) check_owner(source, orderer);
  for (const SendTarget& target : order.send) {
    const PacsSettings& pacs = pacs_of(settings, target.pacs, "send.pacs");
    if (rule == nullptr || request.send) check_owner(pacs, orderer);
  }
  order.label_volume = request.label_volume;
  check_labels(order);
  add_sent_files(order);
  record.owner = rule != nullptr && orderer.is_administrator && !rule->owner.empty() ? rule->owner
                                                                                     : orderer.name;
  record.work.label = rule == nullptr ? kLabel : rule->label;
  record.work.series_number = rule == nullptr ? kSeriesNumber : rule->series_number;
  if (rule != nullptr) record.work.max_error_mm = rule->max_error_mm;
  if (request.callback) record.work.callback = request.callback->url;
  return record;
}

void check_searchable(const HospitalSettings& settings, const Orderer& person,
                      const std::string& pacs) {
  const PacsSettings* found = settings.find_pacs(pacs);
  if (found == nullptr) {
    throw Error(ErrorCode::kNotFound, "there is no PACS of that name: GET /v1/pacs lists them");
  }
  if (!may_use(*found, person)) {
    throw Error(ErrorCode::kForbidden,
                "this login may not search this PACS: the operator lists who may (pacs.owners)");
  }
  if (found->dicomweb.empty()) {
    throw invalid_parameter("name",
                            "is a PACS without DICOMweb, which cannot be searched: meshes are only "
                            "sent to it. The operator can give its address (pacs.dicomweb)");
  }
}

store::OrderRecord make_order(const Rule& rule, const std::string& pacs,
                              const FoundSeries& series) {
  store::OrderRecord record = new_record();
  record.owner = rule.owner;
  Order& order = record.order;
  order.rule = rule.name;
  order.source = {.pacs = pacs, .study = series.study, .series = series.series};
  order.parameters = parse_order_parameters(rule.parameters, "", "parameters.");
  order.send = rule.send;
  add_sent_files(order);
  record.work.label = rule.label;
  record.work.series_number = rule.series_number;
  record.work.max_error_mm = rule.max_error_mm;
  return record;
}

}  // namespace isomesh::orders
