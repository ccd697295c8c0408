#include "server/hospital/records/order_rules.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "base/clock.h"
#include "proto/error.h"
#include "server/store/damaged_records.h"

namespace isomesh::store {

std::optional<Order> readable_order(const std::string& record, const std::string& id) {
  try {
    Order order = order_from_record(record);
    if (order.id == id) return order;
  } catch (const Error&) {
    // Logged below, as a record of another order is.
  }
  report_damaged("order", id);
  return std::nullopt;
}

void throw_damaged_order() {
  constexpr const char* kReason =
      "the record of this order is damaged: cancel the order, and submit it again";
  throw Error(ErrorCode::kInternal, kReason, {{"id", kReason}});
}

bool is_done(const LastOrder& last, const WatchedSeries& series) {
  // Without a number, nobody can tell whether instances have come since.
  if (!series.instances || last.instances == *series.instances) return true;
  if (!last.state) return false;
  if (!is_final(*last.state)) return true;
  return last.order && last.order->source.instances == series.instances;
}

namespace {

// True if one of the series' instances is one of the order, but with another content.
bool is_changed(const std::vector<std::string>& of_order, const std::vector<std::string>& now) {
  const auto instance_of = [](const std::string& content) {
    return std::string_view(content).substr(0, content.find(' '));
  };
  std::map<std::string_view, std::string_view> known;
  for (const std::string& content : of_order) known[instance_of(content)] = content;
  return std::ranges::any_of(now, [&](const std::string& content) {
    const auto before = known.find(instance_of(content));
    return before != known.end() && before->second != content;
  });
}

}  // namespace

ReceivedFate fate_of(const LastOrder& last, const WatchedSeries& series, Time newest) {
  const bool is_all = last.instances == series.instances;
  if (!last.state) return is_all ? ReceivedFate::kDone : ReceivedFate::kNew;
  if (!is_final(*last.state)) return ReceivedFate::kOpen;
  if (!is_all) return ReceivedFate::kNew;
  if (!last.order) return ReceivedFate::kNew;  // its images may not have become a mesh
  if (is_changed(last.contents, series.contents)) return ReceivedFate::kNew;
  const Order& order = *last.order;
  const bool is_over = order.state == OrderState::kSucceeded ||
                       (order.finished && newest <= time_of(*order.finished));
  return is_over ? ReceivedFate::kDone : ReceivedFate::kNew;
}

bool end_at_worklist(OrderRecord& record, OrderState end) {
  auto& workitem = record.work.workitem;
  if (!workitem || workitem->ending || record.is_damaged) return false;
  workitem->ending = end;
  record.order.next_attempt.reset();
  record.work.failures = 0;
  record.work.begun = timestamp();  // telling the worklist has all the time again
  return true;
}

void cancel_order(OrderRecord& record) {
  record.order.state = OrderState::kCancelled;
  record.order.finished = timestamp();
  record.order.next_attempt.reset();
}

void begin_anew(OrderRecord& record) {
  if (record.order.state != OrderState::kFailed) {
    throw Error(ErrorCode::kNotReady, "only a failed order can be retried");
  }
  Order& order = record.order;
  // Orders always have a PACS, unless their record was damaged.
  if (order.source.pacs.empty()) {
    throw Error(ErrorCode::kNotReady, "what was ordered is lost: submit a new order");
  }
  order.state = OrderState::kWaiting;
  order.finished.reset();
  order.next_attempt.reset();
  order.error.reset();
  order.attempts = 0;
  order.volume.reset();
  order.job.reset();
  order.results.clear();
  order.source.instances.reset();
  OrderWork& work = record.work;
  work.listed.clear();
  work.listed_since.reset();
  work.failures = 0;
  work.failed_in.reset();
  work.looks = 0;
  work.begun = timestamp();
  work.identity.reset();
  work.blobs.clear();
  work.triangles.reset();
  if (work.workitem) {
    work.workitem->told.reset();
    work.workitem->ending.reset();
  }
}

}  // namespace isomesh::store
