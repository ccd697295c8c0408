// A PACS accessed by DICOMweb (PS3.18): QIDO-RS, WADO-RS and STOW-RS.
#pragma once

#include <filesystem>

#include "server/hospital/dicomweb/http_peer.h"
#include "server/hospital/dicomweb/search.h"
#include "server/hospital/orders/pacs.h"
#include "server/import/message/import_message.h"
#include "server/jobs/library/import_runner.h"

namespace isomesh::dicomweb {

using import::PeersResponse;

// Parses a PACS's response in a confined process. Throws Error kPacsUnreachable if it cannot be
// read, and as jobs::ImportRunner::read_response does.
PeersResponse read_response(jobs::ImportRunner& runner, const std::filesystem::path& file);

// Throws PacsFailure unless the status promises a response of the requested kind.
void check_status(const PeerResponseHead& head);

class DicomWeb : public orders::Archive, public orders::ObjectReceiver {
 public:
  // `scratch` is a folder for responses; the limit of bytes applies to one series. `responses`
  // reads them, and must outlive this object.
  DicomWeb(const orders::PacsSettings& settings, std::filesystem::path scratch,
           std::uint64_t most_series_bytes, jobs::ImportRunner& responses);

  orders::RecentSeries find_recent(const std::string& from_day, const std::string& modality,
                                   const std::stop_token& stop) override;
  PacsSeriesList search(const SeriesQuery& query, std::chrono::steady_clock::time_point until,
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
  bool has_instance(const orders::InstancePlace& place, const std::stop_token& stop) override;
  std::string segmented_series(const std::string& study, const std::string& series,
                               const std::stop_token& stop) override;
  void store(const orders::OutgoingObject& object, const std::stop_token& stop) override;

 private:
  using Until = std::optional<std::chrono::steady_clock::time_point>;

  SearchPage fetch_page(const std::string& target, const std::stop_token& stop, Until until = {});
  SearchResults search(const SearchQuery& query, const std::stop_token& stop, Until until = {});
  // Adds those of the study's series that are asked for.
  void add_series(PacsSeriesList& found, const PacsSeries& study, const SeriesQuery& query,
                  const std::stop_token& stop, Until until);
  // Returns the object with that UID.
  std::optional<PeersObject> search_one(const std::string& target, std::string PeersObject::*name,
                                        const std::string& uid, const std::stop_token& stop);
  // Empty if the PACS does not support the search.
  std::optional<orders::RecentSeries> find_series_of_all_studies(const std::string& query,
                                                                 const std::stop_token& stop);

  const orders::PacsSettings settings_;
  const HttpPeer peer_;
  const std::filesystem::path scratch_;
  const std::uint64_t most_series_bytes_;
  jobs::ImportRunner& responses_;
};

}  // namespace isomesh::dicomweb
