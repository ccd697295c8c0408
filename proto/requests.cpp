#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <nlohmann/json.hpp>

#include "proto/fields.h"
#include "proto/json.h"

namespace isomesh {
namespace {

// Collects what is wrong with every member, so that one answer names all of it.
class RequestReader {
 public:
  // Faults are named as a query spells them: `format` for `formats`, no `draco.` or `components.`
  // before their members.
  void name_as_in_query() { as_in_query_ = true; }

  // Reads `json` into `value`, whose fields are those of `visit`, and refuses any other.
  template <class T>
  void read_object(const Json& json, T& value, const std::string& prefix) {
    std::vector<std::string> known;
    visit(value, [&](const char* name, auto& member) {
      known.emplace_back(name);
      if (const auto found = json.find(name); found != json.end()) {
        read_member(*found, prefix + name, member);
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

  void read_member(const Json& json, const std::string& name, std::string& value) {
    if (!json.is_string()) return add(name, "must be a string");
    value = json.get<std::string>();
  }

  void read_member(const Json& json, const std::string& name, std::optional<double>& value) {
    if (json == (name == "iso" ? Json("otsu") : Json(nullptr))) return value.reset();
    double number = 0;
    read_member(json, name, number);
    value = number;
  }

  void read_member(const Json& json, const std::string& name, Scheme& value) {
    if (json == 5) {
      value = Scheme::kFive;
    } else if (json == 6) {
      value = Scheme::kSix;
    } else {
      add(name, "must be 5 or 6");
    }
  }

  void read_member(const Json& json, const std::string& name, Enumeration auto& value) {
    using Enum = std::remove_reference_t<decltype(value)>;
    const auto known = json.is_string() ? from_string<Enum>(json.get<std::string>()) : std::nullopt;
    if (!known) return add(name, "must be " + names_of<Enum>());
    value = *known;
  }

  void read_member(const Json& json, const std::string& name, int& value) {
    const auto [low, high] = range_of(name);
    const bool whole = json.is_number() && std::floor(json.get<double>()) == json.get<double>();
    if (!whole || json.get<double>() < low || json.get<double>() > high) {
      return add(name, "must be a whole number from " + std::to_string(low) + " to " +
                           std::to_string(high));
    }
    value = static_cast<int>(json.get<double>());
  }

  void read_member(const Json& json, const std::string& name, double& value) {
    const double number = json.is_number() ? json.get<double>() : std::nan("");
    if (name == "lambda" && !(number > 0 && number <= 1)) {
      add(name, "must be a number above 0 and at most 1");
    } else if (name == "pass_band" && !(number > 0 && number <= 0.5)) {
      add(name, "must be a number above 0 and at most 0.5");
    } else if (name == "max_displacement_mm" && !(std::isfinite(number) && number >= 0)) {
      add(name, "must be a finite number of at least 0");
    } else if (!std::isfinite(number)) {
      add(name, "must be a finite number or \"otsu\"");  // the iso-value
    } else {
      value = number;
    }
  }

  void read_member(const Json& json, const std::string& name, bool& value) {
    if (!json.is_boolean()) return add(name, "must be true or false");
    value = json.get<bool>();
  }

  void read_member(const Json& json, const std::string& name, std::vector<MeshFormat>& formats) {
    if (!json.is_array() || json.empty()) {
      return add(name, "must be a list of at least one of " + names_of<MeshFormat>());
    }
    formats.clear();
    for (const Json& element : json) {
      MeshFormat format{};
      const std::size_t before = errors_.size();
      read_member(element, name, format);
      if (errors_.size() > before) return;
      if (std::ranges::find(formats, format) == formats.end()) formats.push_back(format);
    }
  }

  void read_member(const Json& json, const std::string& name, std::optional<std::uint32_t>& value) {
    constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
    if (json.is_null()) return value.reset();
    const double number = json.is_number() ? json.get<double>() : 0;
    if (std::floor(number) != number || !(number >= 1 && number <= kMost)) {
      return add(name, "must be a whole number from 1 to 4294967295");
    }
    value = static_cast<std::uint32_t>(number);
  }

  void read_member(const Json& json, const std::string& name, ComponentFilter& value) {
    if (!json.is_object()) return add(name, "must be an object");
    read_object(json, value, name + ".");
  }

  void read_member(const Json& json, const std::string& name, DracoParameters& value) {
    if (!json.is_object()) return add(name, "must be an object");
    read_object(json, value, name + ".");
  }

  void read_member(const Json& json, const std::string& name, std::optional<Callback>& value) {
    if (json.is_null()) return value.reset();
    if (!json.is_object()) return add(name, "must be an object");
    read_object(json, value.emplace(), name + ".");
    if (!json.contains("url")) add(name + ".url", "is required");
  }

  static std::pair<int, int> range_of(const std::string& name) {
    if (name == "passes") return {0, 1000};
    if (name == "draco.position_bits") return {8, 30};
    return {0, 10};  // draco.speed
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

// The object that holds a member which a query names without it; empty for the others.
std::string owner_of(const std::string& name) {
  if (name == "position_bits" || name == "speed") return "draco";
  if (name == "keep" || name == "min_triangles") return "components";
  return "";
}

JobParameters read_parameters(const Json& json, bool with_volume, RequestReader& reader) {
  JobParameters parameters;
  reader.read_object(json, parameters, "");
  if (with_volume && !json.contains("volume")) reader.add("volume", "is required");
  if (!json.contains("iso")) reader.add("iso", "is required");
  // With more, what varies fastest would grow with every pass, whatever the pass-band.
  constexpr double kMostOfTaubin = 0.66;
  if (parameters.smoothing == Smoothing::kTaubin && parameters.lambda > kMostOfTaubin) {
    reader.add("lambda", "must be at most 0.66 for \"taubin\"");
  }
  reader.throw_if_any();
  if (!parameters.lambda) parameters.lambda = default_lambda(parameters.smoothing);
  return parameters;
}

}  // namespace

std::string spelled_in_query(const std::string& member) {
  if (member == "formats") return "format";
  const std::size_t owner = member.find('.');
  return owner == std::string::npos ? member : member.substr(owner + 1);
}

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

JobParameters parse_job_parameters(const std::vector<std::pair<std::string, std::string>>& query,
                                   VolumeIn volume_in) {
  RequestReader reader;
  std::vector<std::string> misplaced;
  Json json = Json::object();
  for (const auto& [name, text] : query) {
    const std::string owner_name = owner_of(name);
    Json& owner = owner_name.empty() ? json : json[owner_name];
    const std::string member = name == "format" ? "formats" : name;
    const bool is_text = name == "volume" && volume_in == VolumeIn::kQuery;
    if ((name == "volume" && !is_text) || name == "draco" || name == "components" ||
        name == "formats" || name == "callback") {
      misplaced.push_back(name);
    } else if (owner.contains(member)) {
      reader.add(name, "is given twice");
    } else {
      owner[member] = is_text ? Json(text) : name == "format" ? list_of(text) : value_of(text);
    }
  }
  for (const std::string& name : misplaced) {
    reader.add(name, "is not a parameter of this request");
  }
  reader.name_as_in_query();
  return read_parameters(json, volume_in == VolumeIn::kQuery, reader);
}

}  // namespace isomesh
