#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/fields.h"
#include "proto/json.h"

namespace isomesh {
namespace {

// What a query calls a parameter, where it stands in a body and how its text is read.
struct QueryName {
  enum class Kind { kValue, kText, kTexts, kLabels };

  std::string path;
  Kind kind = Kind::kValue;
};

template <class Member>
constexpr QueryName::Kind kind_of() {
  if (std::is_same_v<Member, std::string>) return QueryName::Kind::kText;
  if (std::is_same_v<Member, std::vector<MeshFormat>>) return QueryName::Kind::kTexts;
  if (std::is_same_v<Member, std::optional<LabelChoice>>) return QueryName::Kind::kLabels;
  return QueryName::Kind::kValue;
}

// The table's parameters by their names in a query.
const std::map<std::string, QueryName>& query_names() {
  static const std::map<std::string, QueryName> names = [] {
    std::map<std::string, QueryName> by_name;
    JobParameters parameters;  // not constant, for those members that may be absent
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

// Collects what is wrong with every member, so that one answer names all of it.
class RequestReader {
 public:
  // Faults are named as a query spells them: `format` for `formats`, no `draco.` or `components.`
  // before their members.
  void name_as_in_query() { as_in_query_ = true; }

  // Reads `json` into `value`, whose parameters are those of `visit`, and refuses any other member.
  template <class T>
  void read_object(const Json& json, T& value, const std::string& prefix) {
    std::vector<std::string> known;
    visit(value, [&](const Parameter& parameter, auto& member) {
      known.emplace_back(parameter.name);
      if (const auto found = json.find(parameter.name); found != json.end()) {
        read_member(*found, prefix + parameter.name, parameter, member);
      }
    });
    for (const auto& [name, unused] : json.items()) {
      if (std::ranges::find(known, name) == known.end()) {
        add(prefix + name, "is not a known member");
      }
    }
  }

  void add(const std::string& field, const std::string& message) {
    if (errors_.size() >= kMostErrors) return;
    errors_.push_back({spelled(field.substr(0, kLongestName)), message});
  }

  void throw_if_any() {
    if (!errors_.empty()) throw invalid_parameters(std::move(errors_));
  }

 private:
  std::string spelled(const std::string& field) const {
    return as_in_query_ ? spelled_in_query(field) : field;
  }

  static constexpr std::size_t kMostErrors = 20;
  static constexpr std::size_t kLongestName = 64;

  static bool fits(const Parameter& parameter, double number) {
    return std::isfinite(number) && !(parameter.minimum && number < *parameter.minimum) &&
           !(parameter.above && number <= *parameter.above) &&
           !(parameter.maximum && number > *parameter.maximum);
  }

  // `kind` of number, and what the table says that it may be.
  void refuse(const std::string& path, const std::string& kind, const Parameter& parameter) {
    const std::string range = range_of(parameter);
    std::string message = "must be a " + kind + (range.empty() ? "" : ' ' + range);
    if (parameter.when_empty != nullptr)
      message += " or \"" + std::string(parameter.when_empty) + '"';
    add(path, message);
  }

  template <class Whole>
  void read_whole(const Json& json, const std::string& path, const Parameter& parameter,
                  Whole& value) {
    const double number = json.is_number() ? json.get<double>() : std::nan("");
    if (std::floor(number) != number || !fits(parameter, number)) {
      return refuse(path, "whole number", parameter);
    }
    value = static_cast<Whole>(number);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   std::string& value) {
    if (!json.is_string()) return add(path, "must be a string");
    value = json.get<std::string>();
  }

  template <class Number>
  requires std::is_arithmetic_v<Number>
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::optional<Number>& value) {
    const Json empty = parameter.when_empty == nullptr ? Json(nullptr) : Json(parameter.when_empty);
    if (json == empty) return value.reset();
    read_member(json, path, parameter, value.emplace());
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   Scheme& value) {
    if (json == 5) {
      value = Scheme::kFive;
    } else if (json == 6) {
      value = Scheme::kSix;
    } else {
      add(path, "must be 5 or 6");
    }
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   Enumeration auto& value) {
    using Enum = std::remove_reference_t<decltype(value)>;
    const auto known = json.is_string() ? from_string<Enum>(json.get<std::string>()) : std::nullopt;
    if (!known) return add(path, "must be " + names_of<Enum>());
    value = *known;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   int& value) {
    read_whole(json, path, parameter, value);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::uint32_t& value) {
    read_whole(json, path, parameter, value);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   double& value) {
    const double number = json.is_number() ? json.get<double>() : std::nan("");
    // Without an upper bound "a number" would take in the infinite ones.
    if (!fits(parameter, number)) {
      return refuse(path, parameter.maximum ? "number" : "finite number", parameter);
    }
    value = number;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   bool& value) {
    if (!json.is_boolean()) return add(path, "must be true or false");
    value = json.get<bool>();
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<MeshFormat>& formats) {
    if (!json.is_array() || json.empty()) {
      return add(path, "must be a list of at least one of " + names_of<MeshFormat>());
    }
    formats.clear();
    for (const Json& element : json) {
      MeshFormat format{};
      const std::size_t before = errors_.size();
      read_member(element, path, parameter, format);
      if (errors_.size() > before) return;
      if (std::ranges::find(formats, format) == formats.end()) formats.push_back(format);
    }
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::int64_t& value) {
    read_whole(json, path, parameter, value);
  }

  // Ascending, each once.
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<std::int64_t>& values) {
    if (!json.is_array() || json.empty() || json.size() > Volume::kMostLabels) {
      return add(
          path, "must be a list of 1 to " + std::to_string(Volume::kMostLabels) + " whole numbers");
    }
    for (const Json& element : json) {
      const std::size_t before = errors_.size();
      read_member(element, path, parameter, values.emplace_back());
      if (errors_.size() > before) return values.clear();
    }
    std::ranges::sort(values);
    values.erase(std::unique(values.begin(), values.end()), values.end());
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::optional<LabelChoice>& value) {
    value.emplace();
    if (json == kAllLabels) return;
    if (!json.is_array()) {
      return add(path, "must be \"all\" or a list of labels, which are whole numbers");
    }
    read_member(json, path, parameter, value->values);
  }

  // By the labels' own values.
  template <class T>
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::map<std::int64_t, T>& value) {
    if (!json.is_object() || json.size() > Volume::kMostLabels) {
      return add(path, "must be an object with at most " + std::to_string(Volume::kMostLabels) +
                           " members, which are named by labels");
    }
    for (const auto& [name, element] : json.items()) {
      const bool is_plain = name.find_first_not_of("-0123456789") == std::string::npos;
      const Json label = is_plain ? Json::parse(name, nullptr, false) : Json();
      std::int64_t key = 0;
      const std::size_t before = errors_.size();
      const std::string place = path + '.' + name;
      read_member(label, place, label_range(), key);
      if (errors_.size() == before) read_of_label(element, place, parameter, value[key]);
      if (errors_.size() > before) return;
    }
  }

  void read_of_label(const Json& json, const std::string& path, const Parameter& parameter,
                     std::vector<std::int64_t>& values) {
    read_member(json, path, parameter, values);
  }

  void read_of_label(const Json& json, const std::string& path, const Parameter& parameter,
                     std::string& value) {
    if (!json.is_string()) return add(path, "must be a string");
    read_member(json, path, parameter, value);
    if (std::string_view(parameter.name) == "label_colors") {
      std::ranges::transform(value, value.begin(), [](unsigned char c) { return std::tolower(c); });
      if (!is_color(value)) add(path, "must be a colour such as \"#d8654f\"");
    } else if (trimmed(value).empty() || value.size() > LabelEntry::kMostNameBytes ||
               has_control_characters(value)) {
      add(path, "must be a text of 1 to 255 bytes on one line");
    }
  }

  // What a label may be, as the table has it.
  static const Parameter& label_range() {
    static const Parameter range = [] {
      MeshParameters parameters;  // not constant, for those members that may be absent
      Parameter found;
      visit(parameters, [&](const Parameter& parameter, const auto& /*member*/) {
        if (std::string_view(parameter.name) == "background") found = parameter;
      });
      return found;
    }();
    return range;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   ParameterGroup auto& value) {
    if (!json.is_object()) return add(path, "must be an object");
    read_object(json, value, path + ".");
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   std::optional<Callback>& value) {
    if (json.is_null()) return value.reset();
    if (!json.is_object()) return add(path, "must be an object");
    read_object(json, value.emplace(), path + ".");
    if (!json.contains("url")) add(path + ".url", "is required");
  }

  bool as_in_query_ = false;
  std::vector<FieldError> errors_;
};

// Members that an object has twice: readers differ in which one they take.
class Repetitions {
 public:
  void see(Json::parse_event_t event, const Json& parsed) {
    if (event == Json::parse_event_t::object_start) {
      open_.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      open_.pop_back();
    } else if (event == Json::parse_event_t::key) {
      const auto name = parsed.get<std::string>();
      if (!open_.back().insert(name).second) names_.push_back(name);
    }
  }

  const std::vector<std::string>& names() const { return names_; }

 private:
  std::vector<std::set<std::string>> open_;
  std::vector<std::string> names_;
};

// A query's text as the JSON value that the member would have had in a body.
Json value_of(const std::string& text) {
  const Json parsed = Json::parse(text, nullptr, false);
  return parsed.is_number() || parsed.is_boolean() ? parsed : Json(text);
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

// What the table says of the chosen kind of smoothing alone.
void check_case(const std::string& path, const Parameter& parameter, Smoothing smoothing,
                const std::optional<double>& value, RequestReader& reader) {
  for (const auto& entry : parameter.cases) {
    if (!entry || entry->smoothing != smoothing || !entry->maximum) continue;
    if (!value || *value <= *entry->maximum) continue;
    reader.add(path, "must be at most " + number_text(*entry->maximum) + " for \"" +
                         std::string(to_string(smoothing)) + '"');
  }
}

// What is for iso-values alone, or for labels alone.
void check_labels(const Json& json, const JobParameters& parameters, RequestReader& reader) {
  const auto refuse_if = [&](bool is_wrong, const char* name, const std::string& message) {
    if (is_wrong) reader.add(name, message);
  };
  if (!parameters.labels) {
    const bool zips =
        std::ranges::find(parameters.formats, MeshFormat::kZip) != parameters.formats.end();
    return refuse_if(zips, "formats", "\"zip\" holds a file of each label, so it needs labels");
  }
  refuse_if(json.contains("iso"), "iso", "cannot stand beside labels");
  refuse_if(json.contains("interpolation") && parameters.interpolation == Interpolation::kLinear,
            "interpolation", "must be \"midpoint\" for labels, which have no values between them");
  refuse_if(!parameters.components.keeps_all(), "components",
            "cannot stand beside labels: a part that is left out would leave a hole in its "
            "neighbours");
  const std::string names_background =
      "must not name the background, " + std::to_string(parameters.background);
  refuse_if(std::ranges::binary_search(parameters.labels->values, parameters.background), "labels",
            names_background);
  const bool has_background = std::ranges::any_of(parameters.label_values, [&](const auto& entry) {
    return entry.first == parameters.background ||
           std::ranges::binary_search(entry.second, parameters.background);
  });
  refuse_if(has_background, "label_values", names_background);
}

// The members that such a job has another default for than others.
JobParameters defaults_of(const Json& json) {
  return json.contains("labels") ? label_parameters({}) : JobParameters{};
}

JobParameters read_parameters(const Json& json, bool with_volume, RequestReader& reader) {
  JobParameters parameters = defaults_of(json);
  reader.read_object(json, parameters, "");
  visit_leaves(
      parameters, [&](const std::string& path, const Parameter& parameter, const auto& member) {
        const bool is_expected = parameter.is_required && (with_volume || path != "volume") &&
                                 !(parameter.unless != nullptr && json.contains(parameter.unless));
        if (is_expected && !json.contains(pointer_to(path))) {
          const std::string other = parameter.unless == nullptr ? "" : parameter.unless;
          reader.add(path, other.empty() ? "is required" : "is required, or " + other);
        }
        if constexpr (std::is_same_v<decltype(member), const std::optional<double>&>) {
          check_case(path, parameter, parameters.smoothing, member, reader);
        }
      });
  JobParameters all;  // not constant, for those members that may be absent
  visit(all, [&](const Parameter& parameter, const auto& /*member*/) {
    if (parameter.needs == nullptr || json.contains(parameter.needs)) return;
    if (json.contains(parameter.name)) {
      reader.add(parameter.name, std::string("is only for jobs with ") + parameter.needs);
    }
  });
  check_labels(json, parameters, reader);
  reader.throw_if_any();
  if (!parameters.lambda) parameters.lambda = default_lambda(parameters);
  return parameters;
}

// Members of a body that no query has, or has by another name.
bool is_for_bodies(const std::string& name) {
  bool found = false;
  JobParameters parameters;  // not constant, for those members that an empty one hides
  visit(parameters, [&](const Parameter& parameter, const auto& /*member*/) {
    found = found || name == parameter.name;
  });
  return found && !query_names().contains(name);
}

// A query's text as the JSON value of a body.
Json value_of(const std::string& text, const QueryName& name) {
  switch (name.kind) {
    case QueryName::Kind::kText:
      return text;
    case QueryName::Kind::kTexts:
      return list_of(text);
    case QueryName::Kind::kLabels: {
      if (text == kAllLabels) return text;
      Json labels = list_of(text);
      for (Json& label : labels) label = value_of(label.get<std::string>());
      return labels;
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
    list += text_of(item);
  }
  return list;
}

}  // namespace

JobParameters parse_job_parameters(std::string_view body) {
  RequestReader reader;
  Repetitions repetitions;
  const Json json = Json::parse(
      body,
      [&](int, Json::parse_event_t event, const Json& parsed) {
        repetitions.see(event, parsed);
        return true;
      },
      false);
  if (!json.is_object()) {
    throw Error(ErrorCode::kInvalidParameter, "the body must be one JSON object");
  }
  for (const std::string& name : repetitions.names()) reader.add(name, "is given twice");
  return read_parameters(json, true, reader);
}

std::optional<std::string> parse_volume_name(std::string_view body) {
  constexpr std::size_t kLongest = 255;
  const Json json = Json::parse(body, nullptr, false);
  if (!json.is_object()) {
    throw Error(ErrorCode::kInvalidParameter, "the body must be one JSON object");
  }
  for (const auto& [name, unused] : json.items()) {
    if (name != "name") throw invalid_parameter(name.substr(0, 64), "is not a known member");
  }
  if (!json.contains("name")) throw invalid_parameter("name", "is required");
  if (json["name"].is_null()) return std::nullopt;
  const std::string name = json["name"].is_string() ? json["name"].get<std::string>() : "";
  if (trimmed(name).empty() || name.size() > kLongest || has_control_characters(name)) {
    throw invalid_parameter("name", "must be null or a text of 1 to 255 bytes on one line");
  }
  return std::string(trimmed(name));
}

JobParameters parse_job_parameters(const QueryParameters& query, VolumeIn volume_in) {
  RequestReader reader;
  Json json = Json::object();
  for (const auto& [name, text] : query) {
    const auto known = query_names().find(name);
    if (is_for_bodies(name) || (name == "volume" && volume_in == VolumeIn::kBody)) {
      reader.add(name, "is not a parameter of this request");
    } else if (known == query_names().end()) {
      reader.add(name, "is not a known member");
    } else if (const auto place = pointer_to(known->second.path); json.contains(place)) {
      reader.add(name, "is given twice");
    } else {
      json[place] = value_of(text, known->second);
    }
  }
  reader.name_as_in_query();
  return read_parameters(json, volume_in == VolumeIn::kQuery, reader);
}

QueryParameters to_query(const JobParameters& parameters) {
  const Json json = Json::parse(to_json(parameters));
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
