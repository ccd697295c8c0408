// Interfaces to a PACS, independent of the protocol.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "server/hospital/orders/settings.h"
#include "server/store/blob_store.h"

namespace isomesh::orders {

// Reasons for failures of a PACS; the metrics use the names.
enum class PacsFault {
  kUnreachable,   // no connection, or it was lost
  kTimeout,       // no byte for too long
  kBusy,          // temporarily unable
  kUnauthorized,  // credentials not accepted
  kRefused,       // permanently rejected
  kUnreadable,    // invalid response
  kIncomplete,    // fewer instances than listed, or other ones
  kNotStored,     // storage not confirmed, or not found afterwards
  kChanged,       // the study is missing or belongs to another patient now
};

inline constexpr std::array kPacsFaults = {
    PacsFault::kUnreachable,  PacsFault::kTimeout,   PacsFault::kBusy,
    PacsFault::kUnauthorized, PacsFault::kRefused,   PacsFault::kUnreadable,
    PacsFault::kIncomplete,   PacsFault::kNotStored, PacsFault::kChanged};

std::string_view to_string(PacsFault fault);

// The text contains no address, patient, identifier or text of the PACS.
class PacsFailure : public Error {
 public:
  PacsFailure(PacsFault fault, const std::string& detail, std::chrono::seconds retry_after = {});

  PacsFault fault() const { return fault_; }
  // True if a retry may succeed.
  bool may_pass() const { return fault_ != PacsFault::kRefused; }

 private:
  PacsFault fault_;
};

struct FoundSeries {
  std::string study;
  std::string series;
  std::string modality;
  std::string description;
  std::optional<std::uint32_t> instances;  // empty: unknown
};

struct RecentSeries {
  std::vector<FoundSeries> series;
  bool is_cut = false;  // the PACS has more, but does not list them
};

// True for the modalities of our own objects, which are not images.
bool is_own_modality(std::string_view modality);

// False for those that a PACS tells although the query excludes them, as it ignores what it does
// not support, and for our own objects. Only the PACS knows how it compares names.
bool is_asked_for(const PacsSeries& series, const SeriesQuery& query);

struct InstancePlace {
  std::string study;
  std::string series;
  std::string instance;
};

struct OutgoingObject {
  InstancePlace place;
  std::string sop_class;
  std::uint64_t bytes = 0;
  // Reads up to buffer.size() bytes from `offset`; may throw.
  std::function<std::size_t(std::uint64_t offset, std::span<std::byte> buffer)> read;
  // The same bytes as a file, for sending by another process.
  store::LocalBlob file = {};
};

// A source of an order's images. Thread safe. All methods may throw PacsFailure, and Error
// kCancelled if `stop` is requested.
class SeriesSource {
 public:
  virtual ~SeriesSource() = default;

  // Empty if there is no such series.
  virtual std::optional<FoundSeries> find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token& stop) = 0;

  // The UIDs of all its instances, ascending and unique.
  virtual std::vector<std::string> list_instances(const std::string& study,
                                                  const std::string& series,
                                                  const std::stop_token& stop) = 0;

  // Writes all instances to `target` as multipart/related; returns the Content-Type.
  virtual std::string fetch_series(const std::string& study, const std::string& series,
                                   const std::filesystem::path& target,
                                   const std::stop_token& stop) = 0;
};

// A PACS that can be queried. As SeriesSource.
class Archive : public SeriesSource {
 public:
  // Series of studies since that day (DA), of that modality unless it is empty.
  virtual RecentSeries find_recent(const std::string& from_day, const std::string& modality,
                                   const std::stop_token& stop) = 0;

  // The series that are asked for, of at most `query.limit` studies, the newest first. Results
  // after `until` are dropped.
  virtual PacsSeriesList search(const SeriesQuery& query,
                                std::chrono::steady_clock::time_point until,
                                const std::stop_token& stop) = 0;

  // The study's Patient ID; empty if there is no such study.
  virtual std::optional<std::string> patient_of(const std::string& study,
                                                const std::stop_token& stop) = 0;

  virtual bool has_instance(const InstancePlace& place, const std::stop_token& stop) = 0;

  // The series of images that a series of one segmentation refers to; empty if unknown.
  virtual std::string segmented_series(const std::string& study, const std::string& series,
                                       const std::stop_token& stop) = 0;
};

// A PACS that stores objects. As SeriesSource.
class ObjectReceiver {
 public:
  virtual ~ObjectReceiver() = default;

  // Returns once the PACS has confirmed that it stored this object, or that it has one with this
  // UID, which an earlier attempt stored.
  virtual void store(const OutgoingObject& object, const std::stop_token& stop) = 0;
};

struct FoundWorkitem {
  std::string uid;
  std::string state;            // "SCHEDULED" and so on
  std::string readiness;        // of its input: "READY" and so on
  std::string patient_id = {};  // empty: unknown
  std::string study;            // of its only input; empty if there are several or none
  std::string series;
  std::vector<std::string> procedures;  // VALUE^SCHEME^MEANING
};

// A worklist of Unified Procedure Steps (PS3.18, 11). As SeriesSource.
class Worklist {
 public:
  virtual ~Worklist() = default;

  virtual std::vector<FoundWorkitem> find_scheduled(const std::stop_token& stop) = 0;

  // Empty if there is no such workitem.
  virtual std::optional<FoundWorkitem> find_workitem(const std::string& uid,
                                                     const std::stop_token& stop) = 0;

  // Both return false if the worklist rejects this because of the state or the transaction of the
  // workitem, or does not have it.
  virtual bool change_state(const Workitem& item, const std::string& state,
                            const std::stop_token& stop) = 0;
  // `changes` is a JSON object of attributes.
  virtual bool update(const Workitem& item, const std::string& changes,
                      const std::stop_token& stop) = 0;
};

// The capabilities of a peer; null for those it lacks.
struct Peer {
  std::shared_ptr<SeriesSource> source;
  std::shared_ptr<Archive> archive;
  std::shared_ptr<ObjectReceiver> receiver;
  std::shared_ptr<Worklist> worklist = {};
};

}  // namespace isomesh::orders
