#include "server/import/peers/response.h"

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

constexpr const char* kModality = "00080060";
constexpr const char* kSeriesDescription = "0008103E";
constexpr const char* kReferencedSopInstanceUid = "00081155";
constexpr const char* kFailureReason = "00081197";
constexpr const char* kFailedSopSequence = "00081198";
constexpr const char* kReferencedSopSequence = "00081199";
constexpr const char* kSopInstanceUid = "00080018";
constexpr const char* kPatientId = "00100020";
constexpr const char* kStudyInstanceUid = "0020000D";
constexpr const char* kSeriesInstanceUid = "0020000E";
constexpr const char* kNumberOfSeriesRelatedInstances = "00201209";

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

std::string tag_text(const Json& object, const char* tag) {
  constexpr std::size_t kLongest = 1024;
  const Json* value = tag_value(object, tag);
  if (value == nullptr || !json::is_string(*value)) return "";
  // Spaces around a value are not significant. The same values of images are read without them.
  return printable(dicom::without_padding(json::text(*value)).substr(0, kLongest));
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

PeersObject found_object(const Json& object) {
  if (!json::is_object(object)) throw_unreadable();
  return {.study = uid_of(object, kStudyInstanceUid),
          .series = uid_of(object, kSeriesInstanceUid),
          .instance = uid_of(object, kSopInstanceUid),
          .patient_id = tag_text(object, kPatientId),
          .modality = tag_text(object, kModality),
          .series_description = tag_text(object, kSeriesDescription),
          .instances = tag_number<std::uint32_t>(object, kNumberOfSeriesRelatedInstances)};
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
  } else if (json::is_object(root)) {
    response.stored = referenced(root, kReferencedSopSequence);
    response.failed = referenced(root, kFailedSopSequence);
  } else {
    throw_unreadable();
  }
  return response;
}

}  // namespace isomesh::import
