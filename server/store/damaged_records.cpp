#include "server/store/damaged_records.h"

#include <cstddef>
#include <set>

#include "base/log.h"
#include "base/mutex.h"
#include "proto/error.h"
#include "proto/json.h"

namespace isomesh::store {

namespace {

constexpr const char* kDamagedVolume =
    "the record of this volume is damaged: restore it from a backup, or delete the volume";

// True for the first time that it is called with that text.
bool is_new(const std::string& text) {
  // Beyond this number some are logged again.
  constexpr std::size_t kMostKnown = 10'000;
  static Mutex mutex;
  static std::set<std::string> known;
  const Lock lock(mutex);
  if (known.size() >= kMostKnown) known.clear();
  return known.insert(text).second;
}

}  // namespace

bool is_of_damaged_database(const Error& error) {
  return error.code() == ErrorCode::kInternal && !error.fields().empty() &&
         error.fields().front().field == kDatabaseField;
}

void report_damaged_table(std::string_view what) {
  if (!is_new(std::string(what))) return;
  log_error("the database is damaged, and some {} cannot be read: restore it from a backup", what);
}

void report_damaged(std::string_view kind, const std::string& id) {
  if (!is_new(std::string(kind) + ' ' + id)) return;
  log_error("the record of {} {} is damaged: no version of this service wrote it", kind, id);
}

std::optional<Volume> readable_volume(const std::string& record, const std::string& id) {
  try {
    Volume volume = volume_from_record(record);
    if (volume.id == id) return volume;
  } catch (const Error&) {
    // Logged below, as a record of another volume is.
  }
  report_damaged("volume", id);
  return std::nullopt;
}

void throw_damaged_volume(const std::string& field) {
  throw Error(ErrorCode::kInternal, kDamagedVolume, {{field, kDamagedVolume}});
}

bool is_of_damaged_volume(const Error& error) {
  return error.code() == ErrorCode::kInternal && !error.fields().empty() &&
         error.fields().front().message == kDamagedVolume;
}

}  // namespace isomesh::store
