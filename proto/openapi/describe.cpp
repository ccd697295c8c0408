#include "proto/openapi/describe.h"

#include <cctype>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/openapi/schemas.h"
#include "proto/openapi/yaml.h"
#include "proto/parameters.h"
#include "proto/types.h"

namespace isomesh {
namespace {

std::string in_braces(const std::vector<std::string>& items) {
  return items.empty() ? "{}" : "{ " + with_commas(items) + " }";
}

std::string reference(const std::string& kind, const std::string& name) {
  return "$ref: '#/components/" + kind + '/' + name + "'";
}

// --- The schema of a member's type ---------------------------------------------------------------

template <class T>
constexpr bool kIsOptional = false;
template <class T>
constexpr bool kIsOptional<std::optional<T>> = true;

template <class T>
constexpr bool kIsCallback = std::is_same_v<T, std::optional<Callback>>;

template <class T>
constexpr bool kIsChoice = Enumeration<T>;

template <class T>
constexpr bool kIsOfLabels = std::is_same_v<T, LabelTexts> || std::is_same_v<T, LabelValues>;

template <class T>
std::string name_of(const T& value) {
  return std::string(to_string(value));
}

template <class T>
std::string type_of() {
  if constexpr (kIsOptional<T>) {
    return "[" + type_of<typename T::value_type>() + ", 'null']";
  } else if constexpr (std::is_same_v<T, bool>) {
    return "boolean";
  } else if constexpr (std::is_same_v<T, double>) {
    return "number";
  } else if constexpr (std::is_same_v<T, SchemeName>) {
    return "[integer, string]";
  } else if constexpr (std::is_integral_v<T>) {
    return "integer";
  } else {
    return "string";
  }
}

template <class T>
std::string default_of(const T& value) {
  if constexpr (kIsOptional<T>) {
    return "null";
  } else if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else if constexpr (std::is_arithmetic_v<T>) {
    return number_text(value);
  } else if constexpr (std::is_same_v<T, std::string>) {
    return value;
  } else {
    return name_of(value);
  }
}

// --- One parameter -------------------------------------------------------------------------------

// PassBand for pass_band; without a trailing unit.
std::string schema_name_of(const Parameter& parameter) {
  std::string name = parameter.name;
  const std::string unit = std::string("_") + parameter.unit;
  if (unit.size() > 1 && name.ends_with(unit)) name.resize(name.size() - unit.size());
  std::string schema;
  bool is_first = true;
  for (const char letter : name) {
    if (letter != '_') {
      schema +=
          is_first ? static_cast<char>(std::toupper(static_cast<unsigned char>(letter))) : letter;
    }
    is_first = letter == '_';
  }
  return schema;
}

// "Null: 1 for `laplacian`, 0.33 for `taubin`, which takes at most 0.66."
std::string cases_in_words(const Parameter& parameter) {
  std::string text;
  for (const SmoothingCase& entry : parameter.cases) {
    if (!entry.standard) continue;
    text += (text.empty() ? " Null: " : ", ") + number_text(*entry.standard) + " for `" +
            std::string(to_string(entry.smoothing)) + '`';
    if (entry.maximum) text += ", which takes at most " + number_text(*entry.maximum);
  }
  return text.empty() ? "" : text + '.';
}

std::string description_of(const Parameter& parameter) {
  const std::string more = parameter.more;
  std::string by_labels = default_by_labels(parameter);
  if (!by_labels.empty()) {
    if (!parse_double(by_labels)) by_labels = '`' + by_labels + '`';
    by_labels = " For labels the default is " + by_labels + '.';
  }
  return parameter.help + (more.empty() ? "" : ' ' + more) + cases_in_words(parameter) + by_labels;
}

void write_bounds(Yaml& yaml, const Parameter& parameter) {
  if (parameter.minimum) yaml.line("minimum: " + number_text(*parameter.minimum));
  if (parameter.above) yaml.line("exclusiveMinimum: " + number_text(*parameter.above));
  if (parameter.maximum) yaml.line("maximum: " + number_text(*parameter.maximum));
}

void write_cases(Yaml& yaml, const Parameter& parameter) {
  if (parameter.cases.empty()) return;
  yaml.under("x-by-smoothing", [&] {
    for (const SmoothingCase& entry : parameter.cases) {
      std::vector<std::string> says;
      if (entry.standard) says.push_back("default: " + number_text(*entry.standard));
      if (entry.maximum) says.push_back("maximum: " + number_text(*entry.maximum));
      yaml.line(std::string(to_string(entry.smoothing)) + ": " + in_braces(says));
    }
  });
}

template <class Enum>
void write_choice(Yaml& yaml, const Parameter& parameter) {
  const std::vector<std::string> names = name_list<Enum>();
  yaml.line("enum: " + in_brackets(names));
  if (parameter.values.front() == nullptr) return;
  yaml.under("x-enumDescriptions", [&] {
    for (std::size_t n = 0; n < names.size(); ++n) {
      const std::string key = std::is_same_v<Enum, SchemeName> ? '\'' + names[n] + '\'' : names[n];
      yaml.text(key, parameter.values.at(n));
    }
  });
}

void write_jobs(Yaml& yaml, const Parameter& parameter) {
  if (parameter.jobs == JobKind::kAtIso) yaml.line("x-jobs: iso");
  if (parameter.jobs == JobKind::kByLabels) yaml.line("x-jobs: labels");
  if (const std::string standard = default_by_labels(parameter); !standard.empty()) {
    yaml.line("x-default-by-labels: " + standard);
  }
}

std::string label_list() {
  return "{ type: array, minItems: 1, items: { " + reference("schemas", "Label") + " } }";
}

constexpr const char* kPlace = "{ type: array, minItems: 3, maxItems: 3, items: { type: number } }";

template <class T>
void write_type(Yaml& yaml, const Parameter& parameter, const T& standard) {
  if constexpr (std::is_same_v<T, std::vector<MeshFormat>>) {
    yaml.line("type: array");
    yaml.line("items: { " + reference("schemas", "MeshFormat") + " }");
    yaml.line("minItems: 1");
    yaml.line("default: " + in_brackets({name_of(standard.front())}));
  } else if constexpr (std::is_same_v<T, std::optional<LabelChoice>>) {
    yaml.under("oneOf", [&] {
      yaml.line("- const: all");
      yaml.line("- " + label_list());
    });
  } else if constexpr (std::is_same_v<T, std::vector<double>>) {
    yaml.line("type: array");
    yaml.line("items: { type: number, exclusiveMinimum: " + number_text(*parameter.above) +
              ", maximum: " + number_text(*parameter.maximum) + " }");
    yaml.line("minItems: 1");
    yaml.line("maxItems: " + std::to_string(MeshParameters::kMostLods));
  } else if constexpr (std::is_same_v<T, std::optional<Box>>) {
    yaml.line("type: [array, 'null']");
    yaml.line(std::string("items: ") + kPlace);
    yaml.line("minItems: 2");
    yaml.line("maxItems: 2");
  } else if constexpr (std::is_same_v<T, std::vector<std::array<double, 3>>>) {
    yaml.line("type: array");
    yaml.line(std::string("items: ") + kPlace);
    yaml.line("minItems: 1");
    yaml.line("maxItems: " + std::to_string(ComponentFilter::kMostPlaces));
  } else if constexpr (kIsOfLabels<T>) {
    yaml.line("type: object");
    yaml.line("propertyNames: { pattern: '^-?[0-9]+$' }");
    const bool is_list = std::is_same_v<T, LabelValues>;
    const bool is_color = parameter.text == TextKind::kColor;
    const std::string text = is_color ? "{ type: string, pattern: '^#[0-9a-fA-F]{6}$' }"
                                      : "{ type: string, minLength: 1, maxLength: " +
                                            std::to_string(LabelEntry::kMostNameBytes) + " }";
    yaml.line("additionalProperties: " + (is_list ? label_list() : text));
    yaml.line("default: {}");
  } else if (parameter.when_empty != nullptr) {
    yaml.under("oneOf", [&] {
      yaml.line("- type: number");
      yaml.line(std::string("- const: ") + parameter.when_empty);
      for (const std::string& name : presets_of(parameter)) yaml.line("- const: " + name);
    });
  } else {
    yaml.line("type: " + type_of<T>());
    if constexpr (kIsChoice<T>) write_choice<T>(yaml, parameter);
    write_bounds(yaml, parameter);
    if (!parameter.is_required) yaml.line("default: " + default_of(standard));
  }
}

template <class T>
void write_schema(Yaml& yaml, const Parameter& parameter, const T& standard) {
  yaml.line(std::string("title: ") + parameter.title);
  yaml.text("description", description_of(parameter));
  write_type(yaml, parameter, standard);
  write_cases(yaml, parameter);
  write_jobs(yaml, parameter);
  if (parameter.query != nullptr) yaml.line(std::string("x-query: ") + parameter.query);
  if (*parameter.unit != '\0') yaml.line(std::string("x-unit: ") + parameter.unit);
  if (parameter.option != nullptr) yaml.line(std::string("x-option: ") + parameter.option);
}

// --- The parts -----------------------------------------------------------------------------------

// Texts and lists are described in place; all others have a schema of their own.
template <class T>
constexpr bool kStandsAlone =
    !std::is_same_v<T, std::string> && !std::is_same_v<T, std::vector<MeshFormat>>;

template <class T>
void write_properties(Yaml& yaml, T& parameters);

template <class T>
void write_property(Yaml& yaml, const Parameter& parameter, T& member) {
  if constexpr (kIsCallback<T> || (kStandsAlone<T> && !ParameterGroup<T>)) {
    yaml.line(std::string(parameter.name) + ": { " +
              reference("schemas", schema_name_of(parameter)) + " }");
  } else {
    yaml.under(parameter.name, [&] {
      if constexpr (ParameterGroup<T>) {
        yaml.text("description", description_of(parameter));
        write_properties(yaml, member);
      } else {
        write_schema(yaml, parameter, member);
      }
    });
  }
}

template <class T>
void write_properties(Yaml& yaml, T& parameters) {
  yaml.line("type: object");
  yaml.line("additionalProperties: false");
  yaml.under("properties", [&] {
    visit(parameters, [&](const Parameter& parameter, auto& member) {
      write_property(yaml, parameter, member);
    });
  });
}

// Not constant, so that `visit` reaches members that may be absent.
JobParameters complete_parameters() {
  JobParameters parameters;
  parameters.callback.emplace();
  return parameters;
}

std::string schemas() {
  Yaml yaml(2);
  JobParameters parameters = complete_parameters();
  visit_leaves(parameters, [&](const std::string&, const Parameter& parameter, const auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    if constexpr (kStandsAlone<Member> && !kIsCallback<Member>) {
      yaml.under(schema_name_of(parameter), [&] { write_schema(yaml, parameter, member); });
    }
  });
  yaml.under("JobParameters", [&] {
    yaml.line(
        "description: The parameters of a job. The same volume and parameters give the same "
        "bytes.");
    write_properties(yaml, parameters);
  });
  std::vector<std::string> required;
  std::vector<std::string> alternatives;
  std::vector<std::string> always;
  visit(parameters, [&](const Parameter& parameter, const auto& /*member*/) {
    if (parameter.is_required && parameter.unless == nullptr) required.emplace_back(parameter.name);
    if (parameter.unless != nullptr) {
      alternatives = {"{ required: [" + std::string(parameter.name) + "] }",
                      "{ required: [" + std::string(parameter.unless) + "] }"};
    }
    if (!parameter.may_be_absent) always.emplace_back(parameter.name);
  });
  const std::string base = "allOf: [{ " + reference("schemas", "JobParameters") + " }]";
  yaml.under("JobRequest", [&] {
    yaml.line(base);
    yaml.line("required: " + in_brackets(required));
    yaml.line("oneOf: " + in_brackets(alternatives));
  });
  yaml.under("CompleteJobParameters", [&] {
    yaml.text("description",
              "The parameters of a job, with the defaults of those that the request left out. A "
              "parameter that is not required here may be absent. It then has its default, or does "
              "not apply to the job.");
    yaml.line(base);
    yaml.under("required", [&] {
      for (const std::string& name : always) yaml.line("- " + name);
    });
  });
  return yaml.str();
}

// Calls each(parameter, member) for parameters that a query spells as a body does.
template <class Each>
void visit_query(const Each& each) {
  JobParameters parameters = complete_parameters();
  visit_leaves(parameters, [&](const std::string&, const Parameter& parameter, const auto& member) {
    if constexpr (kStandsAlone<std::remove_cvref_t<decltype(member)>>) {
      if (parameter.in_query) each(parameter, member);
    }
  });
}

template <class T>
constexpr bool kHoldsPoints =
    std::is_same_v<T, std::optional<Box>> || std::is_same_v<T, std::vector<std::array<double, 3>>>;

template <class T>
constexpr bool kIsList = kHoldsPoints<T> || std::is_same_v<T, std::vector<double>> ||
                         std::is_same_v<T, std::optional<LabelChoice>>;

// A query lists the numbers of all points in one row.
template <class T>
std::string query_schema_of(const Parameter& parameter) {
  if constexpr (kHoldsPoints<T>) {
    constexpr bool kIsBox = std::is_same_v<T, std::optional<Box>>;
    constexpr std::size_t kLeast = kIsBox ? 2 : 1;
    constexpr std::size_t kMost = kIsBox ? 2 : ComponentFilter::kMostPlaces;
    return "type: array, items: { type: number }, minItems: " + std::to_string(3 * kLeast) +
           ", maxItems: " + std::to_string(3 * kMost);
  } else {
    return reference("schemas", schema_name_of(parameter));
  }
}

std::string query() {
  Yaml yaml(2);
  visit_query([&](const Parameter& parameter, const auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    yaml.under(schema_name_of(parameter), [&] {
      yaml.line("name: " + query_name_of(parameter));
      yaml.line("in: query");
      if (parameter.is_required && parameter.unless == nullptr) yaml.line("required: true");
      yaml.text("description", parameter.help);
      yaml.line("schema: { " + query_schema_of<Member>(parameter) + " }");
      if constexpr (kIsList<Member>) {
        yaml.line("style: form");
        yaml.line("explode: false");
      }
    });
  });
  return yaml.str();
}

std::string query_references() {
  Yaml yaml(4);
  visit_query([&](const Parameter& parameter, const auto& /*member*/) {
    yaml.line("- " + reference("parameters", schema_name_of(parameter)));
  });
  return yaml.str();
}

// The start of the line that holds `text`, and of the next line.
std::pair<std::size_t, std::size_t> line_with(const std::string& description,
                                              const std::string& text, std::size_t from) {
  const std::size_t found = description.find("# " + text + '\n', from);
  if (found == std::string::npos) throw std::runtime_error("there is no line \"# " + text + '"');
  return {description.rfind('\n', found) + 1, description.find('\n', found) + 1};
}

}  // namespace

std::string with_parameters(const std::string& description) {
  struct Part {
    std::string source;
    std::string name;
    std::string text;
  };
  const std::vector<Part> parts = {
      {"parameters.h", "schemas of parameters", schemas()},
      {"parameters.h", "formats", schema_of_mesh_formats()},
      {"parameters.h", "parameters of a query", query()},
      {"parameters.h", "query of an estimate", query_references()},
      {"parameters.h", "query of a mesh", query_references()},
      {"volume_formats.h", "formats of volumes", schema_of_volume_formats()},
      {"notes.h", "codes of notes", schemas_of_notes()},
      {"stages.h", "stages of a job", schemas_of_stages()}};
  std::string result = description;
  for (const auto& [source, name, text] : parts) {
    const std::size_t begin = line_with(result, "made of " + source + ": " + name, 0).second;
    const std::size_t end = line_with(result, "end of " + name, begin).first;
    result.replace(begin, end - begin, text);
  }
  return result;
}

}  // namespace isomesh
