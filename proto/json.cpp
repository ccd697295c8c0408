#include "proto/json.h"

#include <cmath>
#include <limits>
#include <type_traits>

#include <nlohmann/json.hpp>

namespace isomesh {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
concept Enumeration = std::is_enum_v<T>;

// --- The fields of every type, each name once. A visitor is called with (name, member). ---------

template <class Self, class T>
concept Is = std::same_as<std::remove_const_t<Self>, T>;

void visit(Is<Volume> auto& self, auto&& field) {
  field("id", self.id);
  field("format", self.format);
  field("dims", self.dims);
  field("type", self.type);
  field("spacing", self.geometry.spacing);
  field("origin", self.geometry.origin);
  field("direction", self.geometry.direction);
  field("range", self.range);
  field("suggested_iso", self.suggested_iso);
  field("bytes", self.bytes);
  field("created", self.created);
}

void visit(Is<DracoParameters> auto& self, auto&& field) {
  field("position_bits", self.position_bits);
  field("speed", self.speed);
}

void visit(Is<JobParameters> auto& self, auto&& field) {
  field("volume", self.volume);
  field("iso", self.iso);
  field("scheme", self.scheme);
  field("interpolation", self.interpolation);
  field("passes", self.passes);
  field("smoothing", self.smoothing);
  field("lambda", self.lambda);
  field("close", self.close);
  field("formats", self.formats);
  field("draco", self.draco);
  field("priority", self.priority);
}

void visit(Is<Timing> auto& self, auto&& field) {
  field("queue", self.queue);
  field("load", self.load);
  field("extract", self.extract);
  field("smooth", self.smooth);
  field("encode", self.encode);
  field("total", self.total);
}

void visit(Is<MeshFile> auto& self, auto&& field) {
  field("bytes", self.bytes);
  field("sha256", self.sha256);
  field("href", self.href);
}

void visit(Is<MeshSummary::Enclosed> auto& self, auto&& field) {
  field("extracted", self.extracted);
  field("smoothed", self.smoothed);
}

void visit(Is<MeshSummary> auto& self, auto&& field) {
  field("triangles", self.triangles);
  field("vertices", self.vertices);
  field("boundary_edges", self.boundary_edges);
  field("components", self.components);
  field("euler", self.euler);
  field("area_mm2", self.area_mm2);
  field("volume_mm3", self.volume_mm3);
  field("bounds", self.bounds);
  field("files", self.files);
}

void visit(Is<FieldError> auto& self, auto&& field) {
  field("field", self.field);
  field("message", self.message);
}

void visit(Is<Problem> auto& self, auto&& field) {
  field("type", self.type);
  field("title", self.title);
  field("status", self.status);
  field("detail", self.detail);
  if (std::is_const_v<std::remove_reference_t<decltype(self)>> ? !self.instance.empty() : true) {
    field("instance", self.instance);
  }
  if (std::is_const_v<std::remove_reference_t<decltype(self)>> ? !self.errors.empty() : true) {
    field("errors", self.errors);
  }
}

// `volume` and `priority` stand beside the parameters too; the members inside are the truth.
void visit(Is<Job> auto& self, auto&& field) {
  field("id", self.id);
  field("state", self.state);
  field("stage", self.stage);
  field("progress", self.progress);
  field("parameters", self.parameters);
  field("volume", self.parameters.volume);
  field("priority", self.parameters.priority);
  field("created", self.created);
  field("started", self.started);
  field("finished", self.finished);
  field("timing", self.timing);
  field("mesh", self.mesh);
  field("error", self.error);
}

// --- Writing -------------------------------------------------------------------------------------

template <class T>
Json write(const T& value);

template <class T>
Json write_optional(const std::optional<T>& value) {
  return value ? write(*value) : Json(nullptr);
}

// An empty iso-value in the parameters means "let Otsu choose".
void write_field(Json& object, const char* name, const std::optional<double>& iso) {
  object[name] = iso ? Json(*iso) : Json("otsu");
}

template <class T>
void write_field(Json& object, const char* name, const std::optional<T>& value) {
  object[name] = write_optional(value);
}

template <class T>
void write_field(Json& object, const char* name, const T& value) {
  object[name] = write(value);
}

template <class T>
Json write(const T& value) {
  if constexpr (std::is_same_v<T, Scheme>) {
    return static_cast<int>(value);
  } else if constexpr (Enumeration<T>) {
    return std::string(to_string(value));
  } else if constexpr (std::is_same_v<T, std::map<MeshFormat, MeshFile>>) {
    Json object = Json::object();
    for (const auto& [format, file] : value) object[std::string(to_string(format))] = write(file);
    return object;
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return Json(value);
  } else if constexpr (requires { value.begin(); }) {
    Json array = Json::array();
    for (const auto& element : value) array.push_back(write(element));
    return array;
  } else {
    Json object = Json::object();
    visit(value, [&](const char* name, const auto& member) { write_field(object, name, member); });
    return object;
  }
}

template <class T>
std::string to_text(const T& value) {
  // A volume's name or a message may hold bytes that are not UTF-8: replaced, never thrown on.
  return write(value).dump(-1, ' ', false, Json::error_handler_t::replace);
}

// --- Reading answers -----------------------------------------------------------------------------

template <class T>
void read(const Json& json, T& value);

template <class T>
constexpr bool kIsOptional = false;
template <class T>
constexpr bool kIsOptional<std::optional<T>> = true;

// Throws as nlohmann's own readers do, where those would take another kind for an empty one.
void check_kind(bool right) {
  if (!right) throw Error(ErrorCode::kInternal, "the server's answer has a member of a wrong kind");
}

template <class T>
void read_field(const Json& json, std::optional<T>& value) {
  if (json.is_null() || (json.is_string() && std::is_same_v<T, double>)) {
    value.reset();
    return;
  }
  read(json, value.emplace());
}

template <class T>
void read_field(const Json& json, T& value) {
  read(json, value);
}

template <class T>
void read(const Json& json, T& value) {
  if constexpr (std::is_same_v<T, Scheme>) {
    value = json.get<int>() == 5 ? Scheme::kFive : Scheme::kSix;
  } else if constexpr (Enumeration<T>) {
    const auto known = from_string<T>(json.get<std::string>());
    if (!known) throw Error(ErrorCode::kInternal, "the server's answer names an unknown value");
    value = *known;
  } else if constexpr (std::is_same_v<T, std::map<MeshFormat, MeshFile>>) {
    check_kind(json.is_object());
    for (const auto& [name, file] : json.items()) {
      if (const auto format = from_string<MeshFormat>(name)) read(file, value[*format]);
    }
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    value = json.get<T>();
  } else if constexpr (requires { value.emplace_back(); }) {
    check_kind(json.is_array());
    value.clear();
    for (const auto& element : json) read(element, value.emplace_back());
  } else if constexpr (requires { value.begin(); }) {
    for (std::size_t i = 0; i < value.size(); ++i) read(json.at(i), value[i]);
  } else {
    check_kind(json.is_object());
    visit(value, [&](const char* name, auto& member) {
      // RFC 9457 requires no member of a problem.
      constexpr bool kMayBeMissing =
          std::is_same_v<T, Problem> || kIsOptional<std::remove_reference_t<decltype(member)>>;
      if (const auto found = json.find(name); found != json.end()) {
        read_field(*found, member);
      } else if (!kMayBeMissing) {
        throw Error(ErrorCode::kInternal, std::string("the server's answer lacks ") + name);
      }
    });
  }
}

template <class T>
T from_text(std::string_view text, const char* list = nullptr) {
  try {
    const Json json = Json::parse(text);
    T value{};
    read(list ? json.at(list) : json, value);
    return value;
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kInternal, "the server's answer is not what the API describes");
  }
}

// --- Reading requests ----------------------------------------------------------------------------

// Collects what is wrong with every member, so that one answer names all of it.
class RequestReader {
 public:
  // Faults are named as a query spells them: `format` for `formats`, no `draco.` before its
  // members.
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
        add(prefix + name.substr(0, kLongestName), "is not a known member");
      }
    }
  }

  void add(const std::string& field, const std::string& message) {
    if (errors_.size() < kMostErrors) errors_.push_back({spelled(field), message});
  }

  void throw_if_any() {
    if (!errors_.empty()) throw invalid_parameters(std::move(errors_));
  }

 private:
  std::string spelled(const std::string& field) const {
    constexpr std::string_view kDraco = "draco.";
    if (!as_in_query_) return field;
    if (field == "formats") return "format";
    return field.starts_with(kDraco) ? field.substr(kDraco.size()) : field;
  }

  static constexpr std::size_t kMostErrors = 20;
  static constexpr std::size_t kLongestName = 64;

  void read_member(const Json& json, const std::string& name, std::string& value) {
    if (!json.is_string()) return add(name, "must be a string");
    value = json.get<std::string>();
  }

  void read_member(const Json& json, const std::string& name, std::optional<double>& iso) {
    if (json == "otsu") return iso.reset();
    if (!json.is_number() || !std::isfinite(json.get<double>())) {
      return add(name, "must be a finite number or \"otsu\"");
    }
    iso = json.get<double>();
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

  void read_member(const Json& json, const std::string& name, double& lambda) {
    if (!json.is_number() || !(json.get<double>() > 0 && json.get<double>() <= 1)) {
      return add(name, "must be a number above 0 and at most 1");
    }
    lambda = json.get<double>();
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

  void read_member(const Json& json, const std::string& name, DracoParameters& value) {
    if (!json.is_object()) return add(name, "must be an object");
    read_object(json, value, name + ".");
  }

  static std::pair<int, int> range_of(const std::string& name) {
    if (name == "passes") return {0, 1000};
    if (name == "draco.position_bits") return {8, 30};
    return {0, 10};  // draco.speed
  }

  bool as_in_query_ = false;
  std::vector<FieldError> errors_;
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

JobParameters read_parameters(const Json& json, bool with_volume, RequestReader& reader) {
  JobParameters parameters;
  reader.read_object(json, parameters, "");
  if (with_volume && !json.contains("volume")) reader.add("volume", "is required");
  if (!json.contains("iso")) reader.add("iso", "is required");
  reader.throw_if_any();
  return parameters;
}

}  // namespace

std::string to_json(const Volume& volume) { return to_text(volume); }
std::string to_json(const Job& job) { return to_text(job); }
std::string to_json(const JobParameters& parameters) { return to_text(parameters); }
std::string to_json(const Problem& problem) { return to_text(problem); }

std::string to_json(const std::vector<Volume>& volumes) {
  return Json{{"volumes", write(volumes)}}.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string to_json(const std::vector<Job>& jobs, const std::string& next) {
  return Json{{"jobs", write(jobs)}, {"next", next.empty() ? Json(nullptr) : Json(next)}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
}

Volume volume_from_json(std::string_view text) { return from_text<Volume>(text); }
Job job_from_json(std::string_view text) { return from_text<Job>(text); }
Problem problem_from_json(std::string_view text) { return from_text<Problem>(text); }

std::vector<Volume> volumes_from_json(std::string_view text) {
  return from_text<std::vector<Volume>>(text, "volumes");
}

std::vector<Job> jobs_from_json(std::string_view text) {
  return from_text<std::vector<Job>>(text, "jobs");
}

JobParameters parse_job_parameters(std::string_view body) {
  const Json json = Json::parse(body, nullptr, false);
  if (!json.is_object()) {
    throw Error(ErrorCode::kInvalidParameter, "the body must be one JSON object");
  }
  RequestReader reader;
  return read_parameters(json, true, reader);
}

JobParameters parse_job_parameters(const std::vector<std::pair<std::string, std::string>>& query) {
  RequestReader reader;
  std::vector<std::string> misplaced;
  Json json = Json::object();
  for (const auto& [name, text] : query) {
    const bool of_draco = name == "position_bits" || name == "speed";
    Json& owner = of_draco ? json["draco"] : json;
    const std::string member = name == "format" ? "formats" : name;
    if (name == "volume" || name == "draco" || name == "formats") {
      misplaced.push_back(name);
    } else if (owner.contains(member)) {
      reader.add(name, "is given twice");
    } else {
      owner[member] = name == "format" ? list_of(text) : value_of(text);
    }
  }
  for (const std::string& name : misplaced) {
    reader.add(name, "is not a parameter of this request");
  }
  reader.name_as_in_query();
  return read_parameters(json, false, reader);
}

}  // namespace isomesh
