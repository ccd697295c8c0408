#include "server/import/peers/answer.h"

#include <cmath>
#include <limits>
#include <string>

#include <nlohmann/json.hpp>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"
#include "proto/orders.h"

namespace isomesh::import {
namespace {

using Json = nlohmann::json;
using process::PeersAnswer;
using process::PeersObject;

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
  throw Error(ErrorCode::kPacsUnreachable, "the response of the PACS is not DICOM JSON");
}

// The first value of an attribute; null if missing.
const Json* value_of(const Json& object, const char* tag) {
  const auto attribute = object.find(tag);
  if (attribute == object.end() || !attribute->is_object()) return nullptr;
  const auto values = attribute->find("Value");
  if (values == attribute->end() || !values->is_array() || values->empty()) return nullptr;
  return &values->front();
}

std::string text_of(const Json& object, const char* tag) {
  constexpr std::size_t kLongest = 1024;
  const Json* value = value_of(object, tag);
  if (value == nullptr || !value->is_string()) return "";
  return printable(value->get<std::string>().substr(0, kLongest));
}

std::string uid_of(const Json& object, const char* tag) {
  std::string uid(trimmed(text_of(object, tag)));
  if (!uid.empty() && !is_uid(uid)) throw_unreadable();
  return uid;
}

// Servers write integers as numbers or, for IS, also as strings.
template <class Number>
std::optional<Number> number_of(const Json& object, const char* tag) {
  const Json* value = value_of(object, tag);
  if (value == nullptr) return std::nullopt;
  const std::optional<double> number = value->is_number() ? value->get<double>()
                                       : value->is_string()
                                           ? parse_double(value->get<std::string>())
                                           : std::nullopt;
  if (!number || !(*number >= 0) || *number > std::numeric_limits<Number>::max() ||
      std::floor(*number) != *number) {
    return std::nullopt;
  }
  return static_cast<Number>(*number);
}

PeersObject found_object(const Json& object) {
  if (!object.is_object()) throw_unreadable();
  return {.study = uid_of(object, kStudyInstanceUid),
          .series = uid_of(object, kSeriesInstanceUid),
          .instance = uid_of(object, kSopInstanceUid),
          .patient_id = text_of(object, kPatientId),
          .modality = text_of(object, kModality),
          .series_description = text_of(object, kSeriesDescription),
          .instances = number_of<std::uint32_t>(object, kNumberOfSeriesRelatedInstances)};
}

std::vector<PeersObject> referenced(const Json& answer, const char* sequence) {
  std::vector<PeersObject> objects;
  if (value_of(answer, sequence) == nullptr) return objects;
  for (const Json& item : answer.at(sequence).at("Value")) {
    if (!item.is_object()) throw_unreadable();
    objects.push_back({.instance = uid_of(item, kReferencedSopInstanceUid),
                       .failure = number_of<std::uint16_t>(item, kFailureReason)});
  }
  return objects;
}

}  // namespace

PeersAnswer read_answer(const std::filesystem::path& file) {
  const std::string text = read_whole(file);
  PeersAnswer answer;
  if (trimmed(text).empty()) return answer;
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_array()) {
    for (const Json& object : json) answer.objects.push_back(found_object(object));
  } else if (json.is_object()) {
    answer.stored = referenced(json, kReferencedSopSequence);
    answer.failed = referenced(json, kFailedSopSequence);
  } else {
    throw_unreadable();
  }
  return answer;
}

}  // namespace isomesh::import
