#include "server/hospital/orders/step_records.h"

#include <utility>

#include "proto/error.h"

namespace isomesh::orders {

void check_identity(const DicomIdentity& identity) {
  for (const auto& [name, text] : {std::pair{"Patient's Name", &identity.patient_name},
                                   {"Patient ID", &identity.patient_id},
                                   {"Issuer of Patient ID", &identity.issuer_of_patient_id},
                                   {"Patient's Birth Date", &identity.patient_birth_date},
                                   {"Patient's Sex", &identity.patient_sex},
                                   {"Accession Number", &identity.accession_number},
                                   {"Study ID", &identity.study_id}}) {
    if (text->find("\xEF\xBF\xBD") == text->npos) continue;
    throw Error(ErrorCode::kUnusableVolume,
                std::string("the ") + name +
                    " of the images has bytes that mean nothing in their Specific Character Set: "
                    "correct the images, and submit the order again");
  }
}

void check_patient_of_workitem(const OrderWork& work, const DicomIdentity& identity) {
  if (!work.workitem || work.workitem->patient_id.empty()) return;
  if (work.workitem->patient_id == identity.patient_id) return;
  throw Error(ErrorCode::kUnusableVolume,
              "the images have another Patient ID than the workitem: correct what is wrong, and "
              "schedule a new workitem");
}

store::AuditEntry transfer(const store::OrderRecord& record, const std::string& pacs,
                           const std::string& direction, const std::string& study) {
  return {.event = store::AuditEvent::kTransferred,
          .success = false,
          .order = record.order.id,
          .owner = record.owner,
          .peer_name = pacs,
          .direction = direction,
          .study = study};
}

void forget_images(store::OrderRecord& record) {
  record.order.state = OrderState::kWaiting;
  record.order.volume.reset();
  record.order.job.reset();
  record.order.results.clear();
  record.order.source.instances.reset();
  record.work.identity.reset();
  record.work.blobs.clear();
  record.work.listed.clear();
  record.work.listed_since.reset();
  record.work.triangles.reset();
  record.work.segmented_series.clear();
}

}  // namespace isomesh::orders
