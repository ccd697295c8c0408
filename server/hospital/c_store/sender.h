// Sends objects by C-STORE (PS3.4, B).
#pragma once

#include "server/hospital/orders/pacs.h"
#include "server/process/prepared.h"

namespace isomesh::c_store {

class Sender : public orders::ObjectReceiver {
 public:
  // `processes` run isomesh-dimse and must outlive this object.
  Sender(const orders::PacsSettings& settings, process::PreparedProcesses& processes)
      : settings_(settings), processes_(processes) {}

  void store(const orders::OutgoingObject& object, const std::stop_token& stop) override;

 private:
  const orders::PacsSettings settings_;
  process::PreparedProcesses& processes_;
};

}  // namespace isomesh::c_store
