#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/fields.h"
#include "proto/json.h"
#include "proto/json_text.h"
#include "proto/request_reader.h"

namespace isomesh {
namespace {

// A query parameter: its place in a body, and how its text is read.
struct QueryName {
  // kPlaces: numbers, three for each point.
  enum class Kind { kValue, kText, kTexts, kLabels, kNumbers, kPlaces };

  std::string path;
  Kind kind = Kind::kValue;
};

template <class Member>
constexpr QueryName::Kind kind_of() {
  if (std::is_same_v<Member, std::string>) return QueryName::Kind::kText;
  if (std::is_same_v<Member, std::vector<MeshFormat>>) return QueryName::Kind::kTexts;
  if (std::is_same_v<Member, std::optional<LabelChoice>>) return QueryName::Kind::kLabels;
  if (std::is_same_v<Member, std::vector<double>>) return QueryName::Kind::kNumbers;
  if (std::is_same_v<Member, std::vector<std::array<double, 3>>> ||
      std::is_same_v<Member, std::optional<Box>>) {
    return QueryName::Kind::kPlaces;
  }
  return QueryName::Kind::kValue;
}

const std::map<std::string, QueryName>& query_names() {
  static const std::map<std::string, QueryName> names = [] {
    std::map<std::string, QueryName> by_name;
    JobParameters parameters;  // not constant, so that `visit` reaches members that may be absent
    visit_leaves(parameters,
                 [&](const std::string& path, const Parameter& parameter, const auto& member) {
                   using Member = std::remove_cvref_t<decltype(member)>;
                   if (!parameter.in_query) return;
                   by_name[query_name_of(parameter)] = {.path = path, .kind = kind_of<Member>()};
                 });
    return by_name;
  }();
  return names;
}

std::string spelled_in_query(const std::string& path) {
  const auto& names = query_names();
  const auto found =
      std::ranges::find_if(names, [&](const auto& entry) { return entry.second.path == path; });
  return found == names.end() ? path : found->first;
}

Json::json_pointer pointer_to(std::string path) {
  std::ranges::replace(path, '.', '/');
  return Json::json_pointer('/' + path);
}

// Replaces half of a surrogate pair. It is a noncharacter, which no text of a request may hold.
constexpr std::string_view kHalfPair = "\uFFFF";

// The code unit of the \u escape at `place` (RFC 8259, 7); 0 if there is none.
unsigned escaped_unit(std::string_view json, std::size_t place) {
  constexpr std::size_t kLength = 6;
  const std::string_view escape = json.substr(std::min(place, json.size()), kLength);
  if (escape.size() < kLength || !escape.starts_with("\\u")) return 0;
  unsigned unit = 0;
  const char* const end = escape.data() + kLength;
  return std::from_chars(escape.data() + 2, end, unit, 16).ptr == end ? unit : 0;
}

// Replaces each unpaired escaped surrogate with kHalfPair. The parser would only say that the text
// is not JSON.
std::string without_half_pairs(std::string_view json) {
  const auto is_high = [](unsigned unit) { return unit >= 0xD800 && unit < 0xDC00; };
  const auto is_low = [](unsigned unit) { return unit >= 0xDC00 && unit < 0xE000; };
  std::string result;
  for (std::size_t next = 0; (next = json.find('\\')) != std::string_view::npos;) {
    const unsigned unit = escaped_unit(json, next);
    const bool is_pair = is_high(unit) && is_low(escaped_unit(json, next + 6));
    const bool is_half = !is_pair && (is_high(unit) || is_low(unit));
    const std::size_t length = is_pair ? 12 : is_half ? 6 : 2;
    result += json.substr(0, next);
    result += is_half ? kHalfPair : json.substr(next, length);
    json.remove_prefix(std::min(next + length, json.size()));
  }
  return result += json;
}

// Finds errors that the parser accepts, during parsing: duplicate members, and texts with
// kHalfPair.
class Flaws {
 public:
  void see(Json::parse_event_t event, const Json& parsed) {
    if (event == Json::parse_event_t::object_start) {
      open_.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      open_.pop_back();
    } else if (event == Json::parse_event_t::key) {
      see_name(parsed.get<std::string>());
    } else if (event == Json::parse_event_t::value && parsed.is_string()) {
      see_text(parsed.get_ref<const std::string&>());
    }
  }

  // The member that is being parsed.
  std::string path() const {
    std::string path;
    for (const Open& each : open_) path += (path.empty() ? "" : ".") + printable(each.name);
    return path;
  }

  const std::vector<std::string>& repeated() const { return repeated_; }
  const std::vector<std::string>& halves() const { return halves_; }

 private:
  struct Open {
    std::set<std::string> names;
    std::string name;
  };

  void see_text(const std::string& text) {
    constexpr std::size_t kMost = 20;  // errors reported
    if (text.find(kHalfPair) == std::string::npos || halves_.size() >= kMost) return;
    halves_.push_back(path());
  }

  void see_name(const std::string& name) {
    open_.back().name = name;
    if (!open_.back().names.insert(name).second) repeated_.push_back(path());
    see_text(name);
  }

  std::vector<Open> open_;
  std::vector<std::string> repeated_;
  std::vector<std::string> halves_;
};

// Converts a query's text to the JSON value that a body would have. Numbers may also be written in
// ways that JSON does not allow, such as ".5".
Json value_of(const std::string& text) {
  const auto parsed = parse_json<Json>(text, nullptr, false);
  if (parsed.is_number() || parsed.is_boolean()) return parsed;
  const auto number = parse_double(text);
  return number && std::isfinite(*number) ? Json(*number) : Json(text);
}

Json list_of(const std::string& text) {
  Json list = Json::array();
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    list.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return list;
}

Json values_of(const std::string& text) {
  Json values = list_of(text);
  for (Json& value : values) value = value_of(value.get<std::string>());
  return values;
}

// Checks the table's limits for the chosen method of smoothing.
void check_case(const std::string& path, const Parameter& parameter, Smoothing smoothing,
                const std::optional<double>& value, RequestReader& reader) {
  for (const SmoothingCase& entry : parameter.cases) {
    if (entry.smoothing != smoothing || !entry.maximum) continue;
    if (!value || *value <= *entry.maximum) continue;
    reader.add(path, "must be at most " + number_text(*entry.maximum) + " for \"" +
                         std::string(to_string(smoothing)) + '"');
  }
}

// Calls each(parameter, member, usual) with the members of both in turn.
template <class Each>
void visit_beside(JobParameters& parameters, JobParameters& usual, const Each& each) {
  std::vector<void*> others;
  visit(usual, [&](const Parameter& /*parameter*/, auto& member) { others.push_back(&member); });
  auto other = others.begin();
  visit(parameters, [&](const Parameter& parameter, auto& member) {
    each(parameter, member, *static_cast<decltype(&member)>(*other++));
  });
}

bool has(const JobParameters& parameters, MeshFormat format) {
  return std::ranges::find(parameters.formats, format) != parameters.formats.end();
}

// Checks the conditions of the table.
void check_conditions(const Json& json, JobParameters& parameters, JobParameters usual,
                      RequestReader& reader) {
  visit_beside(parameters, usual, [&](const Parameter& row, const auto& member, const auto& same) {
    if (!json.contains(row.name)) return;
    if (row.jobs == JobKind::kByLabels && !parameters.labels) {
      reader.add(row.name, "is only for jobs with labels");
    }
    if (row.unless != nullptr && json.contains(row.unless)) {
      reader.add(row.name, std::string("cannot be combined with ") + row.unless);
    }
    if (member == same) return;
    if (row.by_labels != nullptr && parameters.labels) reader.add(row.name, row.by_labels);
    if (row.needs && !has(parameters, *row.needs)) {
      reader.add(row.name, "needs the format \"" + std::string(to_string(*row.needs)) + '"');
    }
  });
}

// Rejects values that do not apply to jobs with labels, or to jobs without them.
void check_labels(const JobParameters& parameters, RequestReader& reader) {
  const auto refuse_if = [&](bool is_wrong, const char* name, const std::string& message) {
    if (is_wrong) reader.add(name, message);
  };
  if (!parameters.labels) {
    refuse_if(
        row_of(parameters.smoothing).is_for_labels_only, "smoothing",
        '"' + std::string(to_string(parameters.smoothing)) + "\" is only for jobs with labels");
    return refuse_if(has(parameters, MeshFormat::kZip), "formats",
                     "\"zip\" holds one file per label, so it needs labels");
  }
  refuse_if(scheme_of(parameters.scheme) == Scheme::kBcc, "scheme",
            "cannot be \"bcc\" with labels: there are no values between two labels");
  const std::string names_background =
      "must not include the background, " + std::to_string(parameters.background);
  refuse_if(std::ranges::binary_search(parameters.labels->values, parameters.background), "labels",
            names_background);
  const bool has_background = std::ranges::any_of(parameters.label_values, [&](const auto& entry) {
    return entry.first == parameters.background ||
           std::ranges::binary_search(entry.second, parameters.background);
  });
  refuse_if(has_background, "label_values", names_background);
}

void complete(const Json& json, JobParameters& parameters, RequestReader& reader) {
  // Clients that send every member also send the default of `close`.
  if (parameters.crop) parameters.close = true;
  // Simplification is measured unless the request says otherwise.
  if (parameters.triangles && !json.contains("certify")) parameters.certify = true;
  if (parameters.max_error_mm) {
    if (json.contains("certify") && !parameters.certify) {
      reader.add("certify", "must be true with max_error_mm, which is measured");
    }
    parameters.certify = true;
  }
  if (parameters.untangle && parameters.passes == 0) {
    reader.add("untangle", "needs smoothing, but passes is 0: no vertex moves");
  }
  const std::vector<double>& lods = parameters.lods;
  const bool is_falling = std::ranges::is_sorted(lods, std::ranges::greater_equal{});
  if (!lods.empty() && (lods.front() != 1 || !is_falling)) {
    reader.add("lods", "must start at 1 and then decrease");
  }
}

// The name of a preset, which otsu takes the place of; empty if there is none.
std::string taken_preset(Json& json) {
  const auto iso = json.find(rows::kIso.name);
  if (iso == json.end() || !iso->is_string()) return {};
  const std::vector<std::string> names = presets_of(rows::kIso);
  std::string name = iso->get<std::string>();
  if (std::ranges::find(names, name) == names.end()) return {};
  *iso = rows::kIso.when_empty;
  return name;
}

JobParameters defaults_of(const Json& json) {
  return json.contains("labels") ? label_parameters({}) : JobParameters{};
}

JobParameters read_parameters(Json json, bool with_volume, RequestReader& reader) {
  JobParameters parameters = defaults_of(json);
  const std::string preset = taken_preset(json);
  reader.read_object(json, parameters, "");
  parameters.preset = preset;
  visit_leaves(parameters, [&](const std::string& path, const Parameter& parameter,
                               const auto& member) {
    const bool is_expected = parameter.is_required && (with_volume || path != "volume") &&
                             !(parameter.unless != nullptr && json.contains(parameter.unless));
    if (is_expected && !json.contains(pointer_to(path))) {
      const std::string other = parameter.unless == nullptr ? "" : parameter.unless;
      reader.add(path, other.empty() ? "is required" : "is required unless " + other + " is given");
    }
    if constexpr (std::is_same_v<decltype(member), const std::optional<double>&>) {
      check_case(path, parameter, parameters.smoothing, member, reader);
    }
  });
  check_conditions(json, parameters, defaults_of(json), reader);
  check_labels(parameters, reader);
  complete(json, parameters, reader);
  reader.throw_if_any();
  if (!parameters.lambda) parameters.lambda = default_lambda(parameters);
  return parameters;
}

struct VolumeName {
  std::optional<std::string> name;
};

void visit(VolumeName& self, auto&& field) {
  field(Parameter{.name = "name", .is_required = true, .may_be_absent = true}, self.name);
}

Json value_of(const std::string& text, const QueryName& name) {
  switch (name.kind) {
    case QueryName::Kind::kText:
      return text;
    case QueryName::Kind::kTexts:
      return list_of(text);
    case QueryName::Kind::kLabels:
      return text == kAllLabels ? Json(text) : values_of(text);
    case QueryName::Kind::kNumbers:
      return values_of(text);
    case QueryName::Kind::kPlaces: {
      Json places = Json::array();
      for (const Json& number : values_of(text)) {
        if (places.empty() || places.back().size() == 3) places.push_back(Json::array());
        places.back().push_back(number);
      }
      return places;
    }
    case QueryName::Kind::kValue:
      break;
  }
  return value_of(text);
}

std::string text_of(const Json& value) {
  if (!value.is_array()) return value.is_string() ? value.get<std::string>() : value.dump();
  std::string list;
  for (const Json& item : value) {
    if (!list.empty()) list += ',';
    list += text_of(item);  // all numbers of all points
  }
  return list;
}

}  // namespace

Json request_body(std::string_view body, RequestReader& reader) {
  Flaws flaws;
  const std::string text = without_half_pairs(body);
  Json json;
  try {
    json = parse_json<Json>(text, [&](int, Json::parse_event_t event, const Json& parsed) {
      flaws.see(event, parsed);
      return true;
    });
  } catch (const Json::out_of_range&) {
    if (const std::string path = flaws.path(); !path.empty()) {
      reader.add(path, "is a number that is too large");
    }
    reader.throw_if_any();
  } catch (const Json::parse_error&) {
    // Answered below, as what is JSON but no object.
  }
  if (!json.is_object()) {
    throw Error(ErrorCode::kInvalidParameter, "the body must be one JSON object");
  }
  for (const std::string& path : flaws.repeated()) reader.add(path, "is given twice");
  if (text == body) return json;
  for (const std::string& path : flaws.halves()) {
    reader.add(path, "has half of a surrogate pair (\\ud800 to \\udfff), which is not a character");
  }
  reader.throw_if_any();
  return json;
}

JobParameters parse_job_parameters(std::string_view body) {
  RequestReader reader;
  return read_parameters(request_body(body, reader), true, reader);
}

std::optional<std::string> parse_volume_name(std::string_view body) {
  constexpr std::size_t kLongest = 255;
  RequestReader reader;
  VolumeName request;
  reader.read_whole_object(request_body(body, reader), request, "");
  const std::optional<std::string>& name = request.name;
  if (name &&
      (trimmed(*name).empty() || name->size() > kLongest || has_control_characters(*name))) {
    reader.add("name", "must be null or a text of 1 to 255 bytes on one line");
  }
  reader.throw_if_any();
  return name ? std::optional(std::string(trimmed(*name))) : std::nullopt;
}

JobParameters parse_job_parameters(const QueryParameters& query, VolumeIn volume_in) {
  RequestReader reader;
  Json json = Json::object();
  for (const auto& [name, text] : query) {
    const auto known = query_names().find(name);
    if (known == query_names().end() || (name == "volume" && volume_in == VolumeIn::kBody)) {
      reader.add(name, "is not a parameter of this request");
    } else if (const auto place = pointer_to(known->second.path); json.contains(place)) {
      reader.add(name, "is given twice");
    } else {
      json[place] = value_of(text, known->second);
    }
  }
  reader.spell_by(spelled_in_query);
  return read_parameters(json, volume_in == VolumeIn::kQuery, reader);
}

QueryParameters to_query(const JobParameters& parameters) {
  const auto json = parse_json<Json>(to_json(parameters));
  QueryParameters query;
  for (const auto& [name, place] : query_names()) {
    const Json::json_pointer pointer = pointer_to(place.path);
    if (!json.contains(pointer)) continue;
    const Json& value = json.at(pointer);
    if (!value.is_null()) query.emplace_back(name, text_of(value));
  }
  return query;
}

}  // namespace isomesh
