#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/sql/sql.h"
#include "server/store/volume_store.h"

namespace isomesh::store {

// Volumes in a database, which must outlive this object.
class SqlVolumeStore : public VolumeStore {
 public:
  explicit SqlVolumeStore(SqlDatabase& database) : database_(database) {}

  std::pair<Volume, bool> add(const std::string& owner, const Volume& volume) override;
  Volume get(const Viewer& viewer, const std::string& id) const override;
  Volume rename(const std::string& owner, const std::string& id,
                const std::optional<std::string>& name) override;
  bool contains(const Viewer& viewer, const std::string& id) const override;
  std::vector<Volume> list(const Viewer& viewer, const std::string& after, std::size_t limit,
                           ListOrder order) const override;
  void erase(const Viewer& viewer, const std::string& id) override;
  bool names(const std::string& blob) const override;
  std::vector<Expirable> unused(const ExpiryFilter& filter, std::size_t limit) const override;
  Expired expire(std::span<const Expirable> volumes, std::uint64_t enough) override;
  std::uint64_t named_bytes() const override;
  OwnedBytes owned_bytes() const override;

 private:
  SqlDatabase& database_;
};

}  // namespace isomesh::store
