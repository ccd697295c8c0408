// The steps by which an order performs a workitem of a worklist (PS3.4, CC): it claims the
// workitem, tells its progress, and tells its end. The order's record has the transaction before
// the workitem is claimed, so each of them can be repeated by another process.
#include <array>

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/hospital/orders/steps.h"

namespace isomesh::orders {
namespace {

using nlohmann::json;
using store::Time;

constexpr const char* kInProgress = "IN PROGRESS";
constexpr const char* kCompleted = "COMPLETED";
constexpr const char* kCanceled = "CANCELED";

json attribute(const char* vr, const json& value) {
  return {{"vr", vr}, {"Value", json::array({value})}};
}

json code_item(const std::string& value, const std::string& scheme, const std::string& meaning) {
  return {{"00080100", attribute("SH", value)},
          {"00080102", attribute("SH", scheme)},
          {"00080104", attribute("LO", meaning.empty() ? value : meaning)}};
}

// DT in UTC.
std::string moment(store::Time time) { return utc_text(time, "%Y%m%d%H%M%S+0000"); }

// Rough shares of the time that orders take.
int percent_of(OrderState state) {
  switch (state) {
    case OrderState::kWaiting:
      return 0;
    case OrderState::kFetching:
      return 10;
    case OrderState::kMeshing:
      return 30;
    default:
      return 80;
  }
}

json with_transaction(const Workitem& item) {
  return json::object({{"00081195", attribute("UI", item.transaction)}});
}

std::string progress_of(const Workitem& item, OrderState state) {
  json changes = with_transaction(item);
  changes["00741002"] =
      attribute("SQ", {{"00741004", attribute("DS", percent_of(state))},
                       {"00741006", attribute("ST", std::string(to_string(state)))}});
  return changes.dump();
}

// The reason has no texts of the order's failure, because these may describe the images.
std::string discontinued(const Workitem& item, const Order& order, store::Time now) {
  const std::string reason =
      order.error ? order.error->title : "The order " + order.id + " was cancelled";
  json changes = with_transaction(item);
  changes["00741002"] = attribute(
      "SQ", {{"00404052", attribute("DT", moment(now))},
             {"00741238", attribute("LT", reason)},
             {"0074100E",
              attribute("SQ", code_item("110513", "DCM", "Discontinued for unspecified reason"))}});
  return changes.dump();
}

json output_of(const OrderResult& result, const std::string& study, const PacsSettings* pacs) {
  json output = {
      {"0020000D", attribute("UI", study)},
      {"0020000E", attribute("UI", result.series_uid)},
      {"0040E020", attribute("CS", "DICOM")},
      {"00081199", attribute("SQ", {{"00081150", attribute("UI", result.sop_class_uid)},
                                    {"00081155", attribute("UI", result.sop_instance_uid)}})}};
  if (pacs != nullptr && !pacs->dicomweb.empty()) {
    const std::string url = pacs->dicomweb + "/studies/" + study + "/series/" + result.series_uid;
    output["0040E025"] = attribute("SQ", json::object({{"00081190", attribute("UR", url)}}));
  } else if (pacs != nullptr) {
    output["0040E021"] = attribute("SQ", json::object({{"00080054", attribute("AE", pacs->aet)}}));
  }
  return output;
}

void cancel_job(const Order& order, store::JobStore& jobs) {
  if (!order.job) return;
  try {
    jobs.cancel(std::nullopt, *order.job);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
  }
}

PacsFailure refused(const std::string& what) { return {PacsFault::kRefused, what}; }

}  // namespace

Worklist& OrderSteps::worklist(const Workitem& item) const {
  if (const auto& worklist = peer(item.worklist).worklist) return *worklist;
  throw refused("this PACS has no worklist");
}

Time OrderSteps::claim(store::OrderRecord& record, const std::stop_token& stop) const {
  Workitem& item = *record.work.workitem;
  Worklist& list = worklist(item);
  // An earlier attempt may have claimed it, although its response was lost. Only the owner can
  // update it then.
  if (!list.change_state(item, kInProgress, stop) &&
      !list.update(item, progress_of(item, record.order.state), stop)) {
    throw refused("another performer has claimed the workitem, or it has ended");
  }
  item.claimed = true;
  return save_after(OrderState::kWaiting, record, now_());
}

bool OrderSteps::tell(store::OrderRecord& record, const std::stop_token& stop) const {
  Workitem& item = *record.work.workitem;
  Worklist& list = worklist(item);
  const bool is_told = item.told == record.order.state;
  if (!is_told && list.update(item, progress_of(item, record.order.state), stop)) {
    item.told = record.order.state;
    save(record, now_());
    return true;
  }
  if (is_told && record.order.state != OrderState::kMeshing) return true;
  const auto found = list.find_workitem(item.uid, stop);
  // A worklist that does not take this update may take the end.
  if (found && found->state == kInProgress) return true;
  cancel_job(record.order, services_.jobs);
  record.order.state = OrderState::kCancelled;
  record.order.finished = timestamp_of(now_());
  record.order.error =
      to_problem(refused("the worklist has ended the workitem"), "/v1/orders/" + record.order.id);
  save(record, now_());
  return false;
}

std::string OrderSteps::performed(const store::OrderRecord& record) const {
  const Workitem& item = *record.work.workitem;
  const std::size_t scheme = item.procedure.find('^') + 1;
  const std::size_t meaning = item.procedure.find('^', scheme) + 1;
  json outputs = json::array();
  for (const OrderResult& result : record.order.results) {
    outputs.push_back(
        output_of(result, record.work.identity->study_uid, settings_.find_pacs(result.pacs)));
  }
  constexpr std::size_t kLongestCode = 16;  // of a code value (SH)
  const std::string& station = settings_.station_name;
  json changes = with_transaction(item);
  changes["00741002"] = attribute("SQ", json::object({{"00741004", attribute("DS", 100)}}));
  changes["00741216"] = attribute(
      "SQ",
      {{"00404019", attribute("SQ", code_item(item.procedure.substr(0, scheme - 1),
                                              item.procedure.substr(scheme, meaning - scheme - 1),
                                              item.procedure.substr(meaning)))},
       {"00404028", attribute("SQ", code_item(std::string(beginning(station, kLongestCode)),
                                              "99ISOMESH", station))},
       {"00404033", {{"vr", "SQ"}, {"Value", outputs}}},
       {"00404050", attribute("DT", moment(time_of(record.order.created)))},
       {"00404051", attribute("DT", moment(now_()))}});
  return changes.dump();
}

Time OrderSteps::tell_end(store::OrderRecord& record, const std::stop_token& stop) const {
  const Workitem& item = *record.work.workitem;
  Worklist& list = worklist(item);
  const bool is_success = item.ending == OrderState::kSucceeded;
  const std::string state = is_success ? kCompleted : kCanceled;
  // Rejected if an earlier attempt ended the workitem; then the state tells.
  list.update(item, is_success ? performed(record) : discontinued(item, record.order, now_()),
              stop);
  if (!list.change_state(item, state, stop) && item.claimed) {
    const auto found = list.find_workitem(item.uid, stop);
    if (found && found->state == kInProgress) {
      throw PacsFailure(PacsFault::kBusy, "the worklist does not accept the end of the workitem");
    }
  }
  if (item.ending == OrderState::kCancelled) cancel_job(record.order, services_.jobs);
  record.order.state = *item.ending;
  record.order.finished = timestamp_of(now_());
  if (is_success) record.order.error.reset();
  return save(record, now_());
}

}  // namespace isomesh::orders
