// The last step of an order: its objects go to their PACS.
#include <algorithm>

#include "base/clock.h"
#include "proto/error.h"
#include "server/hospital/orders/step_records.h"
#include "server/hospital/orders/steps.h"

namespace isomesh::orders {
namespace {

using std::chrono::seconds;
using store::Time;

// An entry of the audit trail about one of the order's objects, which is not stored yet.
store::AuditEntry transfer_out(const store::OrderRecord& record, const OrderResult& result) {
  const DicomIdentity& identity = *record.work.identity;
  store::AuditEntry entry = transfer(record, result.pacs, "out", identity.study_uid);
  entry.instances = 1;
  entry.patient_id = identity.patient_id;
  return entry;
}

// The object, as in OrderWork::sending.
std::string object_of(const OrderResult& result) {
  return result.pacs + ' ' + result.sop_instance_uid;
}

}  // namespace

bool OrderSteps::is_same_patient(const store::OrderRecord& record, const OrderResult& result,
                                 const std::stop_token& stop) const {
  const DicomIdentity& identity = *record.work.identity;
  if (const auto& archive = peer(result.pacs).archive) {
    const auto patient = archive->patient_of(identity.study_uid, stop);
    if (patient) return *patient == identity.patient_id;
  }
  // Only the PACS of the images must know the study.
  if (result.pacs != record.order.source.pacs) return true;
  throw PacsFailure(PacsFault::kChanged, "the study is no longer in the PACS");
}

void OrderSteps::check_patient(store::OrderRecord& record, std::size_t index,
                               const std::stop_token& stop) const {
  if (!is_same_patient(record, record.order.results[index], stop)) {
    forget_images(record);
    // Failures are kept until the order succeeds, because each attempt may store other objects of
    // it.
    record.work.failed_in = OrderState::kSucceeded;
    throw PacsFailure(PacsFault::kChanged,
                      "the study has another Patient ID than the images; they are fetched again");
  }
}

void OrderSteps::check_object(store::OrderRecord& record, std::size_t index,
                              const std::stop_token& stop) const {
  if (!store::is_there_and_intact(services_.blobs, record.work.blobs[index], stop)) {
    record.order.state = OrderState::kMeshing;
    record.work.failed_in = OrderState::kSucceeded;
    throw Error(ErrorCode::kUnavailable,
                "the object is damaged or missing in the store; it is made again");
  }
}

bool OrderSteps::send_one(store::OrderRecord& record, std::size_t index,
                          const std::stop_token& stop) const {
  const OrderResult& result = record.order.results[index];
  const DicomIdentity& identity = *record.work.identity;
  const auto blob = services_.blobs.open(record.work.blobs[index]);
  const auto& receiver = peer(result.pacs).receiver;
  if (!receiver) {
    throw PacsFailure(PacsFault::kRefused, "meshes cannot be stored among received images");
  }
  const InstancePlace place = {.study = identity.study_uid,
                               .series = result.series_uid,
                               .instance = result.sop_instance_uid};
  store::AuditEntry entry = transfer_out(record, result);
  if (record.work.sending != object_of(result)) {
    record.work.sending = object_of(result);
    save(record, now_());
  }
  try {
    receiver->store(
        {.place = place,
         .sop_class = result.sop_class_uid,
         .bytes = blob->size(),
         .read = [&](std::uint64_t offset,
                     std::span<std::byte> bytes) { return blob->read_at(offset, bytes); },
         .file = services_.blobs.local(record.work.blobs[index])},
        stop);
    // A confirmed store proves nothing, so the object is queried.
    if (has_instance(result.pacs, place, stop) == false) return false;
  } catch (const Error&) {
    services_.audit.add(entry);
    throw;
  }
  entry.success = true;
  services_.audit.add(entry);
  return true;
}

// A PACS may know an object before it lists it. So it is queried for some time, with growing
// pauses, before the object is sent again.
Time OrderSteps::look_again(store::OrderRecord& record, std::size_t index) const {
  constexpr int kDelays = 6;
  const Time now = now_();
  if (!record.work.confirmed) record.work.confirmed = timestamp_of(now);
  const auto waited = now - time_of(*record.work.confirmed);
  if (waited < settings_.first_delay * kDelays) {
    return save(record, now + std::max<Time::duration>(waited, seconds(1)));
  }
  record.work.confirmed.reset();
  services_.audit.add(transfer_out(record, record.order.results[index]));
  throw PacsFailure(PacsFault::kNotStored,
                    "the PACS says that it has the mesh, but does not find it");
}

Time OrderSteps::send(store::OrderRecord& record, const std::stop_token& stop) const {
  if (!record.order.results.empty()) check_identity(record.work.identity.value());
  for (std::size_t index = 0; index < record.order.results.size(); ++index) {
    OrderResult& result = record.order.results[index];
    if (result.stored) continue;
    const InstancePlace place = {.study = record.work.identity->study_uid,
                                 .series = result.series_uid,
                                 .instance = result.sop_instance_uid};
    // First: an object with the same UIDs may be that of another patient.
    check_patient(record, index, stop);
    const bool is_sending = record.work.sending == object_of(result);
    if (has_instance(result.pacs, place, stop) != true) {
      if (is_sending && record.work.confirmed) return look_again(record, index);
      record.work.confirmed.reset();
      check_object(record, index, stop);
      if (!send_one(record, index, stop)) return look_again(record, index);
    } else if (is_sending) {
      // An earlier attempt stored it, but its confirmation was lost.
      store::AuditEntry entry = transfer_out(record, result);
      entry.success = true;
      services_.audit.add(entry);
    }
    result.stored = true;
    record.work.sending.reset();
    record.work.confirmed.reset();
    save_after(OrderState::kSending, record, now_());
  }
  if (record.work.workitem) {
    record.work.workitem->ending = OrderState::kSucceeded;
    return save_after(OrderState::kSending, record, now_());
  }
  record.order.state = OrderState::kSucceeded;
  record.order.finished = timestamp_of(now_());
  return save_after(OrderState::kSucceeded, record, now_());
}

}  // namespace isomesh::orders
