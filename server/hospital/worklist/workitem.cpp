#include "server/hospital/worklist/workitem.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "proto/dicom_uid.h"
#include "proto/record_digest.h"
#include "server/store/damaged_records.h"

namespace isomesh::worklist {
namespace {

using nlohmann::json;
using store::WorkitemRecord;
using store::WorkitemState;

constexpr const char* kSopClass = "00080016";
constexpr const char* kSopInstance = "00080018";
constexpr const char* kTransaction = "00081195";
constexpr const char* kModified = "00404010";
constexpr const char* kStart = "00404005";
constexpr const char* kReadiness = "00404041";
constexpr const char* kCancelled = "00404052";
constexpr const char* kState = "00741000";
constexpr const char* kProgress = "00741002";
constexpr const char* kCommunications = "00741008";
constexpr const char* kContactUri = "0074100A";
constexpr const char* kContactName = "0074100C";
constexpr const char* kDiscontinuation = "0074100E";
constexpr const char* kPriority = "00741200";
constexpr const char* kWorklistLabel = "00741202";
constexpr const char* kStepLabel = "00741204";
constexpr const char* kPerformed = "00741216";
constexpr const char* kReason = "00741238";

constexpr const char* kUpsPush = "1.2.840.10008.5.1.4.34.6.1";

const std::string kInconsistent =
    "The submitted request is inconsistent with the state of the UPS Instance.";
const std::string kUpdateInconsistent =
    "The submitted request is inconsistent with the current state of the Workitem.";
const std::string kNotClaimed = "The target URI did not reference a claimed Workitem.";

std::string moment_of(store::Time time) { return utc_text(time, "%Y%m%d%H%M%S+0000"); }

void check_choice(const DataSet& data, const char* tag, std::initializer_list<const char*> known) {
  const std::string value = text_of(data, tag);
  if (std::ranges::find(known, value) != known.end()) return;
  std::string names;
  for (const char* name : known) names += std::string(names.empty() ? "" : ", ") + name;
  throw invalid_parameter(tag, "must be one of " + names);
}

void check_empty(const DataSet& data, const char* tag, const std::string& message) {
  if (!values_of(data, tag).empty()) throw invalid_parameter(tag, message);
}

void check_required(const DataSet& data) {
  for (const char* tag : {kStart, kStepLabel}) {
    if (text_of(data, tag).empty()) throw invalid_parameter(tag, "is required");
  }
}

// Writes the data into the record, with its state and the time of this change.
void store_in(WorkitemRecord& record, DataSet& data, store::Time now) {
  data[kState] = attribute("CS", to_string(record.state));
  data[kModified] = attribute("DT", moment_of(now));
  record.data = with_digest(data.dump());
  if (record.data.size() > kMostBodyBytes) {
    throw Error(ErrorCode::kTooLarge,
                "the workitem would have more than " + std::to_string(kMostBodyBytes) + " bytes");
  }
}

// Attributes that no update may change (PS3.4, table CC.2.5-3: "Not Allowed" for N-SET).
bool is_fixed(const std::string& tag) {
  constexpr std::array<std::string_view, 6> kFixed = {kSopClass,  kSopInstance, "0020000D",
                                                      "00380010", "00380014",   "0040A370"};
  return tag.starts_with("0010") || std::ranges::find(kFixed, tag) != kFixed.end();
}

// The only item of a sequence; an empty one if it has none.
DataSet item_of(const DataSet& data, const char* sequence) {
  const auto& items = values_of(data, sequence);
  return !items.empty() && items.front().is_object() ? items.front() : json::object();
}

// A canceled workitem has the time, and a reason as a code.
void note_cancellation(DataSet& progress, store::Time now) {
  if (values_of(progress, kCancelled).empty()) {
    progress[kCancelled] = attribute("DT", moment_of(now));
  }
  if (values_of(progress, kDiscontinuation).empty()) {
    progress[kDiscontinuation] =
        attribute("SQ", {{"00080100", attribute("SH", "110513")},
                         {"00080102", attribute("SH", "DCM")},
                         {"00080104", attribute("LO", "Discontinued for unspecified reason")}});
  }
}

// The attributes that a completed workitem needs (PS3.4, table CC.2.5-3: P) and that are missing. A
// step may have made nothing, so its output may be empty.
std::string missing_for_completion(const DataSet& data) {
  constexpr std::array kNeeded = {std::pair("00404028", "Performed Station Name Code Sequence"),
                                  std::pair("00404019", "Performed Workitem Code Sequence"),
                                  std::pair("00404050", "Performed Procedure Step Start DateTime"),
                                  std::pair("00404051", "Performed Procedure Step End DateTime")};
  const DataSet performed = item_of(data, kPerformed);
  std::string missing;
  const auto add = [&](const char* tag, const char* name) {
    missing += (missing.empty() ? "" : ", ") + std::string(name) + " (" + tag + ')';
  };
  for (const auto& [tag, name] : kNeeded) {
    if (values_of(performed, tag).empty()) add(tag, name);
  }
  if (!performed.contains("00404033")) add("00404033", "Output Information Sequence");
  return missing;
}

void check_owner(const WorkitemRecord& record, const std::string& transaction,
                 const std::string& warning_if_missing, const std::string& warning_if_wrong) {
  if (transaction.empty()) {
    throw Refusal(ErrorCode::kInvalidParameter,
                  "the Transaction UID is missing: only the performer may change a workitem that "
                  "is IN PROGRESS",
                  warning_if_missing);
  }
  if (transaction != record.transaction) {
    throw Refusal(ErrorCode::kInvalidParameter, "the Transaction UID is not that of the performer",
                  warning_if_wrong);
  }
}

bool is_ended(WorkitemState state) {
  return state == WorkitemState::kCompleted || state == WorkitemState::kCanceled;
}

[[noreturn]] void conflict(const WorkitemRecord& record, const std::string& what) {
  throw Refusal(ErrorCode::kNotReady,
                "the workitem is " + std::string(to_string(record.state)) + what, kInconsistent);
}

void claim(WorkitemRecord& record, const std::string& transaction) {
  if (record.state != WorkitemState::kScheduled) {
    conflict(record, ": only one that is SCHEDULED can become IN PROGRESS");
  }
  record.state = WorkitemState::kInProgress;
  record.transaction = transaction;
}

void end(WorkitemRecord& record, DataSet& data, WorkitemState wanted,
         const std::string& transaction, store::Time now) {
  if (record.state != WorkitemState::kInProgress) {
    conflict(record, ": only one that is IN PROGRESS can become " + std::string(to_string(wanted)));
  }
  check_owner(record, transaction, "The Transaction UID is missing.",
              "The Transaction UID is incorrect.");
  if (wanted == WorkitemState::kCompleted) {
    const std::string missing = missing_for_completion(data);
    if (!missing.empty()) {
      conflict(record, ", and to be COMPLETED it needs, in its UPS Performed Procedure Sequence (" +
                           std::string(kPerformed) + "): " + missing);
    }
  } else {
    DataSet progress = item_of(data, kProgress);
    note_cancellation(progress, now);
    data[kProgress] = attribute("SQ", progress);
  }
  record.state = wanted;
}

}  // namespace

std::string_view to_string(WorkitemState state) {
  switch (state) {
    case WorkitemState::kScheduled:
      return "SCHEDULED";
    case WorkitemState::kInProgress:
      return "IN PROGRESS";
    case WorkitemState::kCompleted:
      return "COMPLETED";
    case WorkitemState::kCanceled:
      return "CANCELED";
  }
  return {};
}

std::string already_in(WorkitemState state) {
  return "The UPS is already in the requested state of " + std::string(to_string(state)) + '.';
}

std::optional<DataSet> readable_data(const WorkitemRecord& record) {
  try {
    return parse_data_set(without_digest(record.data));
  } catch (const Error&) {
    store::report_damaged("workitem", record.uid);
    return std::nullopt;
  }
}

DataSet data_of(const WorkitemRecord& record) {
  if (auto data = readable_data(record)) return *std::move(data);
  throw Error(ErrorCode::kInternal, "the record of this workitem is damaged");
}

WorkitemRecord new_workitem(const std::string& uid, DataSet data, store::Time now) {
  const std::string own = text_of(data, kSopInstance);
  if (!uid.empty() && !own.empty() && own != uid) {
    throw invalid_parameter(kSopInstance, "is another UID than that of the query");
  }
  WorkitemRecord record = {.uid = uid.empty() ? own : uid, .data = {}};
  if (!is_uid(record.uid)) {
    throw invalid_parameter(kSopInstance,
                            "or the query must have the UID of the workitem: /workitems?1.2.3");
  }
  if (text_of(data, kState) != to_string(WorkitemState::kScheduled)) {
    throw invalid_parameter(kState, "must be SCHEDULED");
  }
  check_empty(data, kTransaction, "must be empty: who performs the workitem chooses it");
  for (const char* tag : {kProgress, kPerformed}) {
    check_empty(data, tag, "must be empty: nobody has performed the workitem yet");
  }
  check_choice(data, kPriority, {"HIGH", "MEDIUM", "LOW"});
  check_choice(data, kReadiness, {"INCOMPLETE", "UNAVAILABLE", "READY"});
  check_required(data);
  data.erase(kTransaction);
  data[kSopClass] = attribute("UI", kUpsPush);
  data[kSopInstance] = attribute("UI", record.uid);
  if (text_of(data, kWorklistLabel).empty()) data[kWorklistLabel] = attribute("LO", "isomesh");
  store_in(record, data, now);
  return record;
}

void update(WorkitemRecord& record, DataSet changes, const std::string& transaction,
            store::Time now) {
  const std::string own = text_of(changes, kTransaction);
  if (!transaction.empty() && !own.empty() && own != transaction) {
    throw Refusal(ErrorCode::kInvalidParameter,
                  "the Transaction UID of the data set is another one than that of the query",
                  kUpdateInconsistent);
  }
  const std::string& secret = transaction.empty() ? own : transaction;
  if (is_ended(record.state)) {
    throw Refusal(ErrorCode::kInvalidParameter,
                  "the workitem is " + std::string(to_string(record.state)) +
                      ", and cannot be changed any more",
                  kUpdateInconsistent);
  }
  if (record.state == WorkitemState::kInProgress) {
    check_owner(record, secret, kUpdateInconsistent, kUpdateInconsistent);
  } else if (!secret.empty()) {
    throw Refusal(ErrorCode::kInvalidParameter, "nobody has claimed the workitem", kNotClaimed);
  }
  changes.erase(kTransaction);
  DataSet data = data_of(record);
  for (const auto& [tag, element] : changes.items()) {
    if (data.contains(tag) && data[tag] == element) continue;
    if (tag == kState) throw invalid_parameter(tag, "changes by PUT /workitems/UID/state only");
    if (is_fixed(tag)) throw invalid_parameter(tag, "cannot be changed");
    data[tag] = element;
  }
  check_choice(data, kPriority, {"HIGH", "MEDIUM", "LOW"});
  check_choice(data, kReadiness, {"INCOMPLETE", "UNAVAILABLE", "READY"});
  check_required(data);
  store_in(record, data, now);
}

std::string change_state(WorkitemRecord& record, const DataSet& request, store::Time now) {
  constexpr std::array kWanted = {WorkitemState::kInProgress, WorkitemState::kCompleted,
                                  WorkitemState::kCanceled};
  const std::string name = text_of(request, kState);
  const auto* const wanted = std::ranges::find(kWanted, name, &to_string);
  if (wanted == kWanted.end()) {
    throw invalid_parameter(kState, "must be IN PROGRESS, COMPLETED or CANCELED");
  }
  const std::string transaction = text_of(request, kTransaction);
  if (is_ended(record.state) && *wanted == record.state) return already_in(record.state);
  if (!transaction.empty() && !is_uid(transaction)) {
    throw invalid_parameter(kTransaction, "must be a UID");
  }
  if (transaction.empty()) {
    throw Refusal(ErrorCode::kInvalidParameter, "the Transaction UID is missing",
                  "The Transaction UID is missing.");
  }
  DataSet data = data_of(record);
  if (*wanted == WorkitemState::kInProgress) {
    claim(record, transaction);
  } else {
    end(record, data, *wanted, transaction, now);
  }
  store_in(record, data, now);
  return "";
}

std::string cancel(WorkitemRecord& record, const DataSet& request, store::Time now) {
  switch (record.state) {
    case WorkitemState::kCanceled:
      return already_in(record.state);
    case WorkitemState::kCompleted:
      throw Refusal(ErrorCode::kNotReady, "the workitem is COMPLETED",
                    "The UPS is already COMPLETED.");
    case WorkitemState::kInProgress:
      throw Refusal(
          ErrorCode::kNotReady,
          "the workitem is IN PROGRESS, and this worklist cannot tell its performer, which "
          "is no order of isomesh: ask there",
          "The performer cannot be contacted.");
    case WorkitemState::kScheduled:
      break;
  }
  DataSet data = data_of(record);
  DataSet progress = item_of(data, kProgress);
  for (const char* tag : {kReason, kDiscontinuation}) {
    if (!values_of(request, tag).empty()) progress[tag] = request[tag];
  }
  DataSet contact = json::object();
  for (const char* tag : {kContactUri, kContactName}) {
    if (!values_of(request, tag).empty()) contact[tag] = request[tag];
  }
  if (!contact.empty()) progress[kCommunications] = attribute("SQ", contact);
  note_cancellation(progress, now);
  data[kProgress] = attribute("SQ", progress);
  record.state = WorkitemState::kCanceled;
  store_in(record, data, now);
  return "";
}

}  // namespace isomesh::worklist
