#include "server/import/peers/response.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/files.h"
#include "base/text.h"
#include "proto/dicom_uid.h"
#include "proto/error.h"
#include "proto/json_tree.h"
#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import {
namespace {

namespace json = json_values;

constexpr const char* kStudyDate = "00080020";
constexpr const char* kModality = "00080060";
constexpr const char* kStudyDescription = "00081030";
constexpr const char* kSeriesDescription = "0008103E";
constexpr const char* kReferencedSeriesSequence = "00081115";
constexpr const char* kReferencedSopInstanceUid = "00081155";
constexpr const char* kFailureReason = "00081197";
constexpr const char* kFailedSopSequence = "00081198";
constexpr const char* kReferencedSopSequence = "00081199";
constexpr const char* kSopInstanceUid = "00080018";
constexpr const char* kPatientName = "00100010";
constexpr const char* kPatientId = "00100020";
constexpr const char* kStudyInstanceUid = "0020000D";
constexpr const char* kSeriesInstanceUid = "0020000E";
constexpr const char* kNumberOfSeriesRelatedInstances = "00201209";
constexpr const char* kCodeValue = "00080100";
constexpr const char* kCodingSchemeDesignator = "00080102";
constexpr const char* kCodeMeaning = "00080104";
constexpr const char* kScheduledWorkitemCodeSequence = "00404018";
constexpr const char* kInputInformationSequence = "00404021";
constexpr const char* kInputReadinessState = "00404041";
constexpr const char* kProcedureStepState = "00741000";

[[noreturn]] void throw_unreadable() {
  throw Error(ErrorCode::kInvalidParameter, "the response of the PACS is not DICOM JSON");
}

JsonTree parsed(std::string_view text) {
  try {
    return JsonTree(text);
  } catch (const Error&) {
    throw_unreadable();
  }
}

// The first value of an attribute; null if missing.
const Json* tag_value(const Json& object, const char* tag) {
  const Json* const attribute = json::find(object, tag);
  const Json* const values = attribute == nullptr ? nullptr : json::find(*attribute, "Value");
  if (values == nullptr || !json::is_array(*values) || json::array_size(*values) == 0) {
    return nullptr;
  }
  return &json::element(*values, 0);
}

std::string shown(const Json* value) {
  constexpr std::size_t kLongest = 1024;
  if (value == nullptr || !json::is_string(*value)) return "";
  // Spaces around a value are not significant. The same values of images are read without them.
  return printable(beginning(dicom::without_padding(json::text(*value)), kLongest));
}

std::string tag_text(const Json& object, const char* tag) { return shown(tag_value(object, tag)); }

// The first way of writing a name that has one (PS3.18, F.2.2). Some servers write only a string.
std::string name_of(const Json& object, const char* tag) {
  const Json* const value = tag_value(object, tag);
  if (value == nullptr || !json::is_object(*value)) return shown(value);
  for (const char* group : {"Alphabetic", "Ideographic", "Phonetic"}) {
    if (std::string name = shown(json::find(*value, group)); !name.empty()) return name;
  }
  return "";
}

std::string uid_of(const Json& object, const char* tag) {
  std::string uid(trimmed(tag_text(object, tag)));
  if (!uid.empty() && !is_uid(uid)) throw_unreadable();
  return uid;
}

// Servers write integers as numbers or, for IS, also as strings.
template <class Number>
std::optional<Number> tag_number(const Json& object, const char* tag) {
  const Json* value = tag_value(object, tag);
  if (value == nullptr) return std::nullopt;
  const std::optional<double> number = json::is_number(*value)   ? json::number(*value)
                                       : json::is_string(*value) ? parse_double(json::text(*value))
                                                                 : std::nullopt;
  if (!number || !(*number >= 0) || *number > std::numeric_limits<Number>::max() ||
      std::floor(*number) != *number) {
    return std::nullopt;
  }
  return static_cast<Number>(*number);
}

// The items of a sequence that are objects.
std::vector<const Json*> items_of(const Json& object, const char* sequence) {
  constexpr std::size_t kMost = 100;
  std::vector<const Json*> items;
  if (tag_value(object, sequence) == nullptr) return items;
  const Json& values = *json::find(*json::find(object, sequence), "Value");
  for (std::size_t at = 0; at < std::min(json::array_size(values), kMost); ++at) {
    if (json::is_object(json::element(values, at))) items.push_back(&json::element(values, at));
  }
  return items;
}

std::string without_carets(std::string text) {
  std::ranges::replace(text, '^', ' ');
  return text;
}

void read_workitem(const Json& object, PeersObject& found) {
  found.workitem_state = tag_text(object, kProcedureStepState);
  if (found.workitem_state.empty()) return;
  found.readiness = tag_text(object, kInputReadinessState);
  for (const Json* code : items_of(object, kScheduledWorkitemCodeSequence)) {
    found.procedures.push_back(without_carets(tag_text(*code, kCodeValue)) + '^' +
                               without_carets(tag_text(*code, kCodingSchemeDesignator)) + '^' +
                               without_carets(tag_text(*code, kCodeMeaning)));
  }
  const auto inputs = items_of(object, kInputInformationSequence);
  found.study = inputs.size() == 1 ? uid_of(*inputs.front(), kStudyInstanceUid) : "";
  found.series = inputs.size() == 1 ? uid_of(*inputs.front(), kSeriesInstanceUid) : "";
}

PeersObject described_object(const Json& object) {
  return {.study = uid_of(object, kStudyInstanceUid),
          .series = uid_of(object, kSeriesInstanceUid),
          .instance = uid_of(object, kSopInstanceUid),
          .patient_id = tag_text(object, kPatientId),
          .patient_name = name_of(object, kPatientName),
          .study_date = tag_text(object, kStudyDate),
          .study_description = tag_text(object, kStudyDescription),
          .modality = tag_text(object, kModality),
          .series_description = tag_text(object, kSeriesDescription),
          .instances = tag_number<std::uint32_t>(object, kNumberOfSeriesRelatedInstances)};
}

PeersObject found_object(const Json& object) {
  if (!json::is_object(object)) throw_unreadable();
  PeersObject found = described_object(object);
  const auto series = items_of(object, kReferencedSeriesSequence);
  if (series.size() == 1) found.segmented_series = uid_of(*series.front(), kSeriesInstanceUid);
  read_workitem(object, found);
  return found;
}

std::vector<PeersObject> referenced(const Json& response, const char* sequence) {
  std::vector<PeersObject> objects;
  if (tag_value(response, sequence) == nullptr) return objects;
  const Json& items = *json::find(*json::find(response, sequence), "Value");
  for (std::size_t at = 0; at < json::array_size(items); ++at) {
    const Json& item = json::element(items, at);
    if (!json::is_object(item)) throw_unreadable();
    objects.push_back({.instance = uid_of(item, kReferencedSopInstanceUid),
                       .failure = tag_number<std::uint16_t>(item, kFailureReason)});
  }
  return objects;
}

}  // namespace

PeersResponse read_response(const std::filesystem::path& file) {
  const std::string text = read_whole(file);
  PeersResponse response;
  if (trimmed(text).empty()) return response;
  const JsonTree tree = parsed(text);
  const Json& root = tree.root();
  if (json::is_array(root)) {
    for (std::size_t at = 0; at < json::array_size(root); ++at) {
      response.objects.push_back(found_object(json::element(root, at)));
    }
  } else if (json::is_object(root) && tag_value(root, kProcedureStepState) != nullptr) {
    response.objects = {found_object(root)};
  } else if (json::is_object(root)) {
    response.stored = referenced(root, kReferencedSopSequence);
    response.failed = referenced(root, kFailedSopSequence);
  } else {
    throw_unreadable();
  }
  return response;
}

}  // namespace isomesh::import
