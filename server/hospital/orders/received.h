// Received series, as a source of images for orders.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/hospital/orders/pacs.h"
#include "server/hospital/records/received_store.h"

namespace isomesh::orders {

// Name of the source of orders for series sent to that AE title. No configured PACS can have it.
std::string received_by(const std::string& title);
bool is_received(std::string_view pacs);
// The AE title of received_by(); empty for a PACS.
std::optional<std::string> title_of(std::string_view pacs);

// The contents of those that are held, as in OrderWork.
std::vector<std::string> contents_of(const std::vector<store::ReceivedInstance>& instances);

// The series sent to one AE title. Thread safe; the stores must outlive it.
class Received : public SeriesSource {
 public:
  Received(std::string title, const store::ReceivedStore& received, const store::BlobStore& blobs)
      : title_(std::move(title)), received_(received), blobs_(blobs) {}

  std::optional<FoundSeries> find_series(const std::string& study, const std::string& series,
                                         const std::stop_token& stop) override;
  std::vector<std::string> list_instances(const std::string& study, const std::string& series,
                                          const std::stop_token& stop) override;
  // Throws PacsFailure kIncomplete if some instances are known but no longer held, or were replaced
  // meanwhile.
  std::string fetch_series(const std::string& study, const std::string& series,
                           const std::filesystem::path& target,
                           const std::stop_token& stop) override;

 private:
  const std::string title_;
  const store::ReceivedStore& received_;
  const store::BlobStore& blobs_;
};

}  // namespace isomesh::orders
