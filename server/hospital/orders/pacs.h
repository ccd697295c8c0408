// What orders ask of a PACS, whatever it is spoken to by.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "server/hospital/orders/hospital.h"
#include "server/store/blob_store.h"

namespace isomesh::orders {

// Why a PACS did not do what it was asked for; the names are those of the metrics.
enum class PacsFault {
  kUnreachable,   // no connection, or one that broke
  kTimeout,       // no byte for too long
  kBusy,          // it says that it may do it later
  kUnauthorized,  // it does not accept who is asking
  kRefused,       // it says that it never will
  kUnreadable,    // an answer that cannot be read
  kIncomplete,    // less than it lists, or other images
  kNotStored,     // it does not say, or does not show, that it has stored
  kChanged,       // the study is not there, or is another patient's now
};

std::string_view to_string(PacsFault fault);

// The text names no address, patient or identifier, and nothing that the PACS wrote.
class PacsFailure : public Error {
 public:
  PacsFailure(PacsFault fault, const std::string& detail, std::chrono::seconds retry_after = {});

  PacsFault fault() const { return fault_; }
  // True: the same may be done later.
  bool may_pass() const { return fault_ != PacsFault::kRefused; }
  std::chrono::seconds retry_after() const { return retry_after_; }

 private:
  PacsFault fault_;
  std::chrono::seconds retry_after_;
};

struct FoundSeries {
  std::string study;
  std::string series;
  std::string modality;
  std::string description;
  std::optional<std::uint32_t> instances;  // where it is told
};

// Where an object stands.
struct InstancePlace {
  std::string study;
  std::string series;
  std::string instance;
};

// An object that is to be stored.
struct OutgoingObject {
  InstancePlace place;
  std::uint64_t bytes = 0;
  // Reads up to buffer.size() bytes from `offset`; may throw.
  std::function<std::size_t(std::uint64_t offset, std::span<std::byte> buffer)> read;
  // The same as a file, for those that another process sends.
  store::LocalBlob file = {};
};

// Thread safe. Everything may throw PacsFailure, and Error kCancelled when `stop` is requested.
class Pacs {
 public:
  virtual ~Pacs() = default;

  // Series of studies of that day (DA) and later, of that modality where one is given.
  virtual std::vector<FoundSeries> find_recent(const std::string& from_day,
                                               const std::string& modality,
                                               const std::stop_token& stop) = 0;

  // Empty when there is no such series.
  virtual std::optional<FoundSeries> find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token& stop) = 0;

  // The UIDs of all of its instances, ascending, each once.
  virtual std::vector<std::string> list_instances(const std::string& study,
                                                  const std::string& series,
                                                  const std::stop_token& stop) = 0;

  // Writes all instances to `target`, as multipart/related; returns its Content-Type.
  virtual std::string fetch_series(const std::string& study, const std::string& series,
                                   const std::filesystem::path& target,
                                   const std::stop_token& stop) = 0;

  // The study's Patient ID; empty when there is no such study.
  virtual std::optional<std::string> patient_of(const std::string& study,
                                                const std::stop_token& stop) = 0;

  // Empty when it cannot be asked: then what it says when it stores is all there is.
  virtual std::optional<bool> has_instance(const InstancePlace& place,
                                           const std::stop_token& stop) = 0;

  // Returns when the PACS has said that it stored just this.
  virtual void store(const OutgoingObject& object, const std::stop_token& stop) = 0;
};

}  // namespace isomesh::orders
