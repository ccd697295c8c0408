// A worklist accessed by UPS-RS (PS3.18, 11).
#pragma once

#include <filesystem>
#include <string>

#include "server/hospital/dicomweb/http_peer.h"
#include "server/hospital/orders/pacs.h"
#include "server/jobs/library/import_runner.h"

namespace isomesh::dicomweb {

class Ups : public orders::Worklist {
 public:
  // As DicomWeb.
  Ups(const orders::PacsSettings& settings, std::filesystem::path scratch,
      jobs::ImportRunner& responses)
      : peer_(settings), scratch_(std::move(scratch)), responses_(responses) {}

  std::vector<orders::FoundWorkitem> find_scheduled(const std::stop_token& stop) override;
  std::optional<orders::FoundWorkitem> find_workitem(const std::string& uid,
                                                     const std::stop_token& stop) override;
  bool change_state(const Workitem& item, const std::string& state,
                    const std::stop_token& stop) override;
  bool update(const Workitem& item, const std::string& changes,
              const std::stop_token& stop) override;

 private:
  bool send(const std::string& target, bool is_put, const std::string& json,
            const std::stop_token& stop) const;

  const HttpPeer peer_;
  const std::filesystem::path scratch_;
  jobs::ImportRunner& responses_;
};

}  // namespace isomesh::dicomweb
