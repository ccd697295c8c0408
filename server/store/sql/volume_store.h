#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/sql/sql.h"
#include "server/store/volume_store.h"

namespace isomesh::store {

// The place of a volume in lists.
struct VolumePlace {
  VolumePlace(std::int64_t created_us, std::string volume)
      : created(created_us), id(std::move(volume)) {}
  // The place after which a list begins: that of cursor_of(), or the list's beginning if empty.
  VolumePlace(const std::string& cursor, ListOrder order);

  std::int64_t created = 0;  // microseconds since 1970
  std::string id;

  auto operator<=>(const VolumePlace&) const = default;
};

// Volumes in a database, which must outlive this object.
class SqlVolumeStore : public VolumeStore {
 public:
  explicit SqlVolumeStore(SqlDatabase& database) : database_(database) {}

  std::pair<Volume, bool> add(const std::string& owner, const Volume& volume) override;
  Volume get(const Viewer& viewer, const std::string& id) const override;
  Volume rename(const std::string& owner, const std::string& id,
                const std::optional<std::string>& name) override;
  std::optional<std::string> samples_of(const Viewer& viewer, const std::string& id) const override;
  bool has_samples(const std::string& owner, const std::string& samples) const override;
  std::string key() const override;
  std::vector<Volume> list(const Viewer& viewer, const std::string& after, std::size_t limit,
                           ListOrder order) const override;
  void erase(const Viewer& viewer, const std::string& id, Made made,
             const BlobsGoing& going) override;
  bool names(const std::string& blob) const override;
  std::vector<Expirable> unused(const ExpiryFilter& filter, std::size_t limit) const override;
  Expired expire(std::span<const Expirable> volumes, std::uint64_t enough) override;
  std::uint64_t named_bytes() const override;
  OwnedBytes owned_bytes() const override;

 private:
  std::vector<Volume> list_after(VolumePlace place, const Viewer& viewer, std::size_t limit,
                                 ListOrder order) const;
  // The same from a table with damaged pages.
  std::vector<Volume> undamaged_after(const VolumePlace& place, const Viewer& viewer,
                                      std::size_t limit, ListOrder order) const;

  SqlDatabase& database_;
};

}  // namespace isomesh::store
