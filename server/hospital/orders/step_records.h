// What several steps do with the record of an order. Private to this folder.
#pragma once

#include <string>

#include "server/hospital/records/order_store.h"
#include "server/store/audit/trail.h"

namespace isomesh::orders {

// An object with an unreadable text would rename the patient in the PACS, or be filed under another
// one. Throws Error kUnusableVolume.
void check_identity(const DicomIdentity& identity);

// Results of one patient's images must not complete the workitem of another one. Throws Error
// kUnusableVolume.
void check_patient_of_workitem(const OrderWork& work, const DicomIdentity& identity);

// An entry of the audit trail that has not succeeded yet.
store::AuditEntry transfer(const store::OrderRecord& record, const std::string& pacs,
                           const std::string& direction, const std::string& study);

// Resets the list of instances, the images, and all results from them.
void forget_images(store::OrderRecord& record);

}  // namespace isomesh::orders
