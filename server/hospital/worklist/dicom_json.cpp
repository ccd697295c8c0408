#include "server/hospital/worklist/dicom_json.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "proto/json_text.h"

namespace isomesh::worklist {
namespace {

using nlohmann::json;

constexpr std::size_t kTagDigits = 8;
// A workitem has sequences within sequences within sequences. Each takes three levels of JSON.
constexpr int kDeepest = 40;

constexpr std::array<std::string_view, 34> kRepresentations = {
    "AE", "AS", "AT", "CS", "DA", "DS", "DT", "FD", "FL", "IS", "LO", "LT",
    "OB", "OD", "OF", "OL", "OV", "OW", "PN", "SH", "SL", "SQ", "SS", "ST",
    "SV", "TM", "UC", "UI", "UL", "UN", "UR", "US", "UT", "UV"};

// The kinds of JSON that values have (PS3.18, table F.2.3-1). Where precision matters, numbers may
// be texts.
constexpr std::array<std::string_view, 6> kNumbers = {"FD", "FL", "SL", "SS", "UL", "US"};
constexpr std::array<std::string_view, 4> kNumbersOrTexts = {"DS", "IS", "SV", "UV"};
constexpr std::array<std::string_view, 7> kBinary = {"OB", "OD", "OF", "OL", "OV", "OW", "UN"};

bool is_in(const auto& list, const std::string& vr) {
  return std::ranges::find(list, vr) != list.end();
}

[[noreturn]] void reject(const std::string& tag, const std::string& message) {
  throw invalid_parameter(tag, message);
}

json bounded_json(std::string_view text) {
  const auto check_depth = [](int depth, json::parse_event_t /*event*/, json& /*parsed*/) {
    if (depth > kDeepest) {
      throw Error(ErrorCode::kInvalidParameter, "the data set is nested too deeply");
    }
    return true;
  };
  try {
    return parse_json<json>(text, json::parser_callback_t(check_depth));
  } catch (const json::exception&) {
    throw Error(ErrorCode::kInvalidParameter,
                "the body must be a data set of the DICOM JSON Model, but is not valid JSON");
  }
}

std::string upper_tag(const std::string& name) {
  std::string tag = name;
  std::ranges::transform(tag, tag.begin(), [](char c) {
    return c >= 'a' && c <= 'f' ? static_cast<char>(c - 32) : c;
  });
  const bool is_tag =
      tag.size() == kTagDigits && tag.find_first_not_of("0123456789ABCDEF") == std::string::npos;
  // Groups below 8 belong to messages and files.
  if (!is_tag || tag < "00080000") {
    constexpr std::size_t kShown = 64;
    reject(name.substr(0, kShown), "is not the tag of an attribute, as in 00741000");
  }
  return tag;
}

DataSet checked(const json& object);

json checked_value(const std::string& tag, const std::string& vr, const json& value) {
  if (value.is_null()) return value;
  if (vr == "SQ") {
    if (!value.is_object()) reject(tag, "must have data sets as values");
    return checked(value);
  }
  if (vr == "PN") {
    const bool is_name = value.is_object() && std::ranges::all_of(value, [](const json& group) {
                           return group.is_string();
                         });
    if (!is_name) reject(tag, "must have names as values, as in {\"Alphabetic\": \"A^B\"}");
    return value;
  }
  if (!value.is_string() && !value.is_number()) {
    reject(tag, "must have texts or numbers as values");
  }
  return value;
}

json checked_attribute(const std::string& tag, const json& element) {
  const auto vr = element.is_object() ? element.find("vr") : element.end();
  if (!element.is_object() || vr == element.end() || !vr->is_string() ||
      !is_in(kRepresentations, vr->get<std::string>())) {
    reject(tag, "must have a vr, as in {\"vr\": \"CS\", \"Value\": [\"READY\"]}");
  }
  json result = {{"vr", *vr}};
  for (const auto& [name, content] : element.items()) {
    if (name == "vr") continue;
    if (name != "Value") reject(tag, "may have only the members vr and Value here");
    if (!content.is_array()) reject(tag, "must have a list as Value");
    json values = json::array();
    for (const json& value : content) {
      values.push_back(checked_value(tag, vr->get<std::string>(), value));
    }
    if (!values.empty()) result["Value"] = std::move(values);
  }
  return result;
}

DataSet checked(const json& object) {
  DataSet data = json::object();
  for (const auto& [name, element] : object.items()) {
    const std::string tag = upper_tag(name);
    data[tag] = checked_attribute(tag, element);
  }
  return data;
}

void check_type(const std::string& tag, const std::string& vr, const json& value) {
  if (!value.is_string() && !value.is_number()) return;  // data sets, names and nothing
  if (is_in(kBinary, vr)) reject(tag, "must have no Value, because its vr is " + vr);
  if (is_in(kNumbersOrTexts, vr)) return;
  const bool wants_number = is_in(kNumbers, vr);
  if (value.is_number() == wants_number) return;
  reject(tag, std::string("must have ") + (wants_number ? "numbers" : "texts") +
                  " as values, because its vr is " + vr);
}

}  // namespace

void check_types(const DataSet& data) {
  for (const auto& [tag, element] : data.items()) {
    for (const json& value : values_of(data, tag)) {
      const auto vr = element.at("vr").get<std::string>();
      check_type(tag, vr, value);
      if (vr == "SQ" && value.is_object()) check_types(value);
    }
  }
}

DataSet parse_data_set(std::string_view text) {
  json body = bounded_json(text);
  if (body.is_array() && body.size() == 1) body = json(std::move(body.front()));
  if (!body.is_object()) {
    throw Error(ErrorCode::kInvalidParameter,
                "the body must be one data set of the DICOM JSON Model, or a list of one");
  }
  return checked(body);
}

const std::vector<json>& values_of(const DataSet& data, std::string_view tag) {
  static const std::vector<json> none;
  const auto found = data.find(std::string(tag));
  if (found == data.end()) return none;
  const auto values = found->find("Value");
  return values == found->end() ? none : values->get_ref<const json::array_t&>();
}

std::string text_of(const DataSet& data, std::string_view tag) {
  const auto& values = values_of(data, tag);
  return !values.empty() && values.front().is_string() ? values.front().get<std::string>() : "";
}

json attribute(std::string_view vr, json value) {
  return {{"vr", vr}, {"Value", json::array({std::move(value)})}};
}

}  // namespace isomesh::worklist
