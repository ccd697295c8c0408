#include "server/store/order_rules.h"

#include "base/clock.h"
#include "proto/error.h"

namespace isomesh::store {

bool is_done(const LastOrder& last, const WatchedSeries& series) {
  if (last.instances == series.instances) return true;
  if (!last.state) return false;
  if (!is_final(*last.state)) return true;
  return order_from_record(*last.record).source.instances == series.instances;
}

ReceivedFate fate_of(const LastOrder& last, const WatchedSeries& series, Time newest) {
  const bool is_all = last.instances == series.instances;
  if (!last.state) return is_all ? ReceivedFate::kDone : ReceivedFate::kNew;
  if (!is_final(*last.state)) return ReceivedFate::kOpen;
  if (!is_all) return ReceivedFate::kNew;
  const Order order = order_from_record(*last.record);
  const bool is_over = order.state == OrderState::kSucceeded ||
                       (order.finished && newest <= time_of(*order.finished));
  return is_over ? ReceivedFate::kDone : ReceivedFate::kNew;
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
}

}  // namespace isomesh::store
