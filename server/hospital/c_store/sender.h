// A PACS that receives objects by C-STORE (PS3.4, B).
#pragma once

#include <memory>

#include "server/hospital/orders/pacs.h"
#include "server/process/prepared.h"

namespace isomesh::c_store {

// Sends by DIMSE. Uses DICOMweb for everything else, if the PACS has it.
class CStore : public orders::Pacs {
 public:
  // `web` is null for a PACS that only receives. `processes` run isomesh-dimse and must outlive
  // this object.
  CStore(const orders::PacsSettings& settings, std::unique_ptr<orders::Pacs> web,
         process::PreparedProcesses& processes)
      : settings_(settings), web_(std::move(web)), processes_(processes) {}

  std::vector<orders::FoundSeries> find_recent(const std::string& from_day,
                                               const std::string& modality,
                                               const std::stop_token& stop) override;
  std::optional<orders::FoundSeries> find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token& stop) override;
  std::vector<std::string> list_instances(const std::string& study, const std::string& series,
                                          const std::stop_token& stop) override;
  std::string fetch_series(const std::string& study, const std::string& series,
                           const std::filesystem::path& target,
                           const std::stop_token& stop) override;
  std::optional<std::string> patient_of(const std::string& study,
                                        const std::stop_token& stop) override;
  std::optional<bool> has_instance(const orders::InstancePlace& place,
                                   const std::stop_token& stop) override;
  void store(const orders::OutgoingObject& object, const std::stop_token& stop) override;

 private:
  // Throws PacsFailure kRefused if there is no DICOMweb.
  orders::Pacs& web() const;

  const orders::PacsSettings settings_;
  const std::unique_ptr<orders::Pacs> web_;
  process::PreparedProcesses& processes_;
};

}  // namespace isomesh::c_store
