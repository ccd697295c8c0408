// Instances that peers have sent by themselves, until an order has had them: the interface behind
// which engines stand. The instances' files are blobs, which are stored before they are named here.
#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "server/store/expiry.h"

namespace isomesh::store {

// A series as it was sent: the same one may be sent to several titles, for several rules.
struct ReceivedSeries {
  std::string route;  // the title that it was sent to
  std::string study;
  std::string series;

  bool operator==(const ReceivedSeries&) const = default;
  bool operator<(const ReceivedSeries& other) const {
    return std::tie(route, study, series) < std::tie(other.route, other.study, other.series);
  }
};

struct ReceivedInstance {
  std::string instance;  // SOP Instance UID
  std::string blob;      // empty: it is not held any more
  std::uint64_t bytes = 0;

  bool operator==(const ReceivedInstance&) const = default;
};

// What is held of a series.
struct HeldSeries {
  ReceivedSeries series;
  std::uint32_t held = 0;   // instances
  std::uint32_t known = 0;  // those, and those that were held before
  Time last;                // when the last one came
};

// Thread safe. Every verb is one transaction. All may throw Error kOutOfSpace (then nothing has
// changed) or kInternal.
class ReceivedStore {
 public:
  virtual ~ReceivedStore() = default;

  // Once this has returned the instance is held, whatever ends. One of the same UID is replaced.
  virtual void add(const ReceivedSeries& series, const ReceivedInstance& instance) = 0;

  // Every series of which something is held.
  virtual std::vector<HeldSeries> held() const = 0;
  virtual std::uint64_t held_bytes() const = 0;

  // All that are known, ascending by their UIDs.
  virtual std::vector<ReceivedInstance> instances(const ReceivedSeries& series) const = 0;

  // Holds nothing of the series any more, and returns the blobs that were held; nothing happens
  // when something has come since `series` was read. The instances stay known.
  virtual std::vector<std::string> release(const HeldSeries& series) = 0;

  // Removes instances that are not held and came before that time. Returns how many.
  virtual std::size_t forget(Time before) = 0;
};

}  // namespace isomesh::store
