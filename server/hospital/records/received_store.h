// The store of instances that peers sent by C-STORE, until an order has used them. The files of
// instances are blobs, stored before they are named here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "server/store/expiry.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// A series as received. The same series may be sent to several AE titles, for several rules.
struct ReceivedSeries {
  std::string route;  // the AE title it was sent to
  std::string study;
  std::string series;

  bool operator==(const ReceivedSeries&) const = default;
  bool operator<(const ReceivedSeries& other) const {
    return std::tie(route, study, series) < std::tie(other.route, other.study, other.series);
  }
};

struct ReceivedInstance {
  std::string instance;  // SOP Instance UID
  std::string blob;      // empty: no longer held
  std::uint64_t bytes = 0;

  bool operator==(const ReceivedInstance&) const = default;
};

// The held instances of a series.
struct HeldSeries {
  ReceivedSeries series;
  std::uint32_t held = 0;   // number of held instances
  std::uint32_t known = 0;  // including instances held earlier
  Time last;                // arrival of the latest instance
};

// Thread safe. Each method is one transaction. All may throw Error kOutOfSpace (nothing has
// changed) or kInternal.
class ReceivedStore {
 public:
  // The database must outlive this object.
  explicit ReceivedStore(SqlDatabase& database) : database_(database) {}
  virtual ~ReceivedStore() = default;

  // The instance survives a crash once this returns. Replaces one with the same UID, and returns
  // the blob of that one if it was another.
  std::optional<std::string> add(const ReceivedSeries& series, const ReceivedInstance& instance);

  // All series with held instances.
  virtual std::vector<HeldSeries> held() const;
  std::uint64_t held_bytes() const;

  // All known instances, ascending by UID.
  virtual std::vector<ReceivedInstance> instances(const ReceivedSeries& series) const;

  // Releases all instances of the series and returns their blobs. Does nothing if an instance has
  // arrived since `series` was read. The instances stay known.
  std::vector<std::string> release(const HeldSeries& series);

  // Removes known instances that are not held and arrived before that time. Returns their number.
  std::size_t forget(Time before);

 private:
  SqlDatabase& database_;
};

}  // namespace isomesh::store
