#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "base/text.h"
#include "client/cli/option_groups.h"
#include "client/cli/option_values.h"
#include "client/cli/text.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

// The default in words, or one for each kind of smoothing; empty if there is none.
template <class T>
std::string default_of(const Parameter& parameter, const T& standard) {
  if constexpr (Enumeration<T>) {
    return std::string(to_string(standard));
  } else if constexpr (std::is_same_v<T, std::vector<MeshFormat>>) {
    return std::string(to_string(standard.front()));
  } else if constexpr (std::is_same_v<T, int> || std::is_same_v<T, std::int64_t> ||
                       std::is_same_v<T, double>) {
    return number_text(standard);
  } else {
    std::string defaults;
    for (const SmoothingCase& entry : parameter.cases) {
      if (!entry.standard) continue;
      defaults += (defaults.empty() ? "" : ", ") + number_text(*entry.standard) + " for " +
                  std::string(to_string(entry.smoothing));
    }
    return defaults;
  }
}

// The enumerated values; empty if there are none.
template <class T>
std::string words_of() {
  if constexpr (Enumeration<T>) {
    return listed(name_list<T>());
  } else {
    return "";
  }
}

// The range of a number. It is left out if it is only that of a type.
std::string limits_of(const Parameter& parameter) {
  constexpr double kLimitOfType = std::numeric_limits<std::uint32_t>::max();
  return parameter.maximum && *parameter.maximum < kLimitOfType ? range_of(parameter) : "";
}

// A row of the table as one sentence of a help text, without its full stop.
template <class T>
std::string help_of(const Parameter& parameter, const T& standard) {
  std::string help = parameter.help;
  std::erase(help, '`');
  if (help.ends_with('.')) help.pop_back();
  const std::string unit = parameter.unit;
  std::string defaults = default_of(parameter, standard);
  if (const std::string by_labels = default_by_labels(parameter); !by_labels.empty()) {
    defaults += (defaults.empty() ? "" : ", ") + by_labels + " with --labels";
  }
  std::string more = words_of<T>() + limits_of(parameter);  // a number has limits, others words
  if (!defaults.empty()) more += (more.empty() ? "default: " : "; default: ") + defaults;
  return help + (unit.empty() ? "" : ", in " + unit) + (more.empty() ? "" : " (" + more + ')');
}

// An option for each kind of parameter.
class ParameterOptions {
 public:
  ParameterOptions(CLI::App& app, std::string& preset) : app_(app), preset_(preset) {}

  template <class T>
  CLI::Option* add(const Parameter& parameter, T& value) {
    const std::string name = "--" + option_name_of(parameter);
    return add_kind(name, parameter, help_of(parameter, value), value);
  }

 private:
  template <class Number>
  CLI::Option* add_plain(const std::string& name, const Parameter& parameter,
                         const std::string& help, auto& value) {
    return add_number<Number>(
        app_, name, help, [&value](Number given) { value = given; },
        must_be(parameter, std::is_integral_v<Number>));
  }

  template <class Number>
  requires std::is_arithmetic_v<Number> CLI::Option* add_kind(const std::string& name,
                                                              const Parameter& parameter,
                                                              const std::string& help,
                                                              Number& value) {
    return add_plain<Number>(name, parameter, help, value);
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, bool& value) {
    CLI::Option* on = app_.add_flag(name, value, help + (value ? " (default)" : ""));
    if (value) {
      const std::string off = "--no-" + name.substr(2);
      app_.add_flag_callback(
              off, [&value] { value = false; }, "Switch off " + name)
          ->excludes(on)
          ->group("Job");
    }
    return on;
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, Enumeration auto& value) {
    using Enum = std::remove_reference_t<decltype(value)>;
    return add_name<Enum>(app_, name, help, [&value](Enum given) { value = given; });
  }

  template <class Number>
  requires std::is_arithmetic_v<Number> CLI::Option* add_kind(const std::string& name,
                                                              const Parameter& parameter,
                                                              const std::string& help,
                                                              std::optional<Number>& value) {
    if (parameter.when_empty == nullptr) return add_plain<Number>(name, parameter, help, value);
    const std::string word = parameter.when_empty;
    const std::vector<std::string> presets = presets_of(parameter);
    std::string type = "N|" + word;
    for (const std::string& each : presets) type += '|' + each;
    return isomesh::cli::add(app_, name, type, help,
                             [this, &value, name, word, presets,
                              wanted = must_be(parameter, false)](const std::string& text) {
                               value = number_from<Number>(text);
                               preset_.clear();
                               if (value || lower(text) == word) return;
                               preset_ = lower(text);
                               if (std::ranges::find(presets, preset_) == presets.end())
                                 refuse(name, wanted);
                             });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::vector<MeshFormat>& value) {
    return isomesh::cli::add(app_, name, type_of_names<MeshFormat>() + ",..", help,
                             [&value, name](const std::string& text) {
                               value.clear();
                               std::stringstream names(text);
                               for (std::string format; std::getline(names, format, ',');) {
                                 value.push_back(name_from<MeshFormat>(name, format));
                               }
                             });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::optional<LabelChoice>& value) {
    return isomesh::cli::add(app_, name, "all|N,N-N,..", help,
                             [&value, name](const std::string& text) {
                               value.emplace();
                               if (text != "all") value->values = labels_from(name, text);
                             });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::vector<double>& value) {
    return isomesh::cli::add(app_, name, "N,..", help, [&value, name](const std::string& text) {
      value.clear();
      for (const std::string_view each : split(text, ',')) {
        const auto number = number_from<double>(each);
        if (!number) refuse(name, "must be numbers separated by commas");
        value.push_back(*number);
      }
    });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::optional<Box>& value) {
    return isomesh::cli::add(
        app_, name, "X,Y,Z,X,Y,Z", help, [&value, name](const std::string& text) {
          const auto numbers = numbers_from<double, 6>(name, text);
          value = {{{numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]}}};
        });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::vector<std::array<double, 3>>& value) {
    return add_repeated(app_, name, "X,Y,Z", help,
                        [&value, name](const std::vector<std::string>& texts) {
                          value.clear();
                          for (const auto& text : texts)
                            value.push_back(numbers_from<double, 3>(name, text));
                        });
  }

  // `--label-name 3=Liver`, once per label.
  template <class T>
  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::map<std::int64_t, T>& value) {
    constexpr bool kIsList = std::is_same_v<T, std::vector<std::int64_t>>;
    return add_repeated(
        app_, name, kIsList ? "LABEL=N,.." : "LABEL=TEXT", help,
        [&value, name](const std::vector<std::string>& texts) {
          for (const std::string& text : texts) {
            const std::size_t sign = text.find('=');
            const auto label = number_from<std::int64_t>(std::string_view(text).substr(0, sign));
            if (sign == std::string::npos || !label) {
              refuse(name, "\"" + text + "\" must begin with a label and =, such as 3=");
            }
            const std::string own = text.substr(sign + 1);
            if constexpr (kIsList) {
              value[*label] = labels_from(name, own);
            } else {
              value[*label] = own;
            }
          }
        });
  }

  // "1,3-5": values and ranges of values.
  static std::vector<std::int64_t> labels_from(const std::string& name, const std::string& text) {
    std::vector<std::int64_t> labels;
    for (const std::string_view each : split(text, ',')) {
      const std::size_t dash = each.find('-', 1);  // a leading one is a sign
      const auto first = number_from<std::int64_t>(each.substr(0, dash));
      const auto last =
          dash == std::string_view::npos ? first : number_from<std::int64_t>(each.substr(dash + 1));
      if (!first || !last || *last < *first) {
        refuse(name,
               "must be whole numbers or ascending ranges separated by commas, such as 1,3-5");
      }
      const std::uint64_t others =
          static_cast<std::uint64_t>(*last) - static_cast<std::uint64_t>(*first);
      if (others >= Volume::kMostLabels - labels.size()) {
        refuse(name, "must be at most " + std::to_string(Volume::kMostLabels) + " labels");
      }
      labels.push_back(*first);  // none counts beyond the last, which may be the largest there is
      for (std::uint64_t n = 0; n < others; ++n) labels.push_back(labels.back() + 1);
    }
    return labels;
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::optional<Callback>& value) {
    return isomesh::cli::add(app_, name, "URL", help,
                             [&value](const std::string& text) { value = Callback{text}; });
  }

  CLI::App& app_;
  std::string& preset_;
};

// Sets which options are required, need others or exclude others.
void relate(const Parameter& parameter, const std::map<std::string, CLI::Option*>& options) {
  CLI::Option* const option = options.at(parameter.name);
  if (parameter.jobs == JobKind::kByLabels && !parameter.is_required) {
    CLI::Option* const labels = options.at("labels");
    if (option != labels) option->needs(labels);
  }
  if (!parameter.is_required) {
    option->group("Job");
  } else if (parameter.unless == nullptr) {
    option->required();
  } else {
    CLI::Option* const other = options.at(parameter.unless);
    option->excludes(other);
  }
}

// The table's options by the paths of their fields; a group has the options of its members.
const std::map<std::string, std::string>& options_of_fields() {
  static const std::map<std::string, std::string> options = [] {
    std::map<std::string, std::vector<std::string>> by_path;
    JobParameters all;
    all.callback.emplace();  // not constant, so that `visit` reaches members that may be absent
    visit_leaves(all, [&](const std::string& path, const Parameter& parameter, const auto&) {
      const std::string option = "--" + option_name_of(parameter);
      by_path[path].push_back(option);
      const std::size_t dot = path.find('.');
      if (dot != std::string::npos) by_path[path.substr(0, dot)].push_back(option);
    });
    std::map<std::string, std::string> texts;
    for (const auto& [path, names] : by_path) texts[path] = listed(names);
    return texts;
  }();
  return options;
}

// The options of raw samples, and those that select within the upload, have their fields' names.
bool is_of_upload(const std::string& field) {
  constexpr std::array kFields = {"dims",      "type",       "spacing",   "origin",
                                  "direction", "byte_order", "series",    "member",
                                  "accept",    "name",       "nifti_form"};
  return std::ranges::find(kFields, field) != kFields.end();
}

// "--label-color" for "label_colors.3".
std::string option_of_field(const std::string& field) {
  std::string name = field;
  const auto& options = options_of_fields();
  if (!options.contains(name)) name = field.substr(0, field.find('.'));
  if (const auto found = options.find(name); found != options.end()) return found->second;
  if (!is_of_upload(name)) return field;
  std::ranges::replace(name, '_', '-');
  return "--" + name;
}

// Replaces field names that are not ordinary words, such as max_error_mm.
std::string with_option_names(std::string text) {
  for (const auto& [path, option] : options_of_fields()) {
    if (path.find('_') == std::string::npos) continue;
    const std::size_t at = text.find(path);
    if (at != std::string::npos) text.replace(at, path.size(), option);
  }
  return text;
}

}  // namespace

void add_parameters(CLI::App& app, JobParameters& parameters, Formats formats, Carrier carrier) {
  // The options' callbacks use it as long as the command's table exists.
  const auto kept = std::make_shared<ParameterOptions>(app, parameters.preset);
  ParameterOptions& all = *kept;
  std::map<std::string, CLI::Option*> options;  // by the parameters' names
  std::vector<Parameter> added;
  visit_leaves(parameters,
               [&](const std::string& /*path*/, const Parameter& parameter, auto& member) {
                 using Member = std::remove_reference_t<decltype(member)>;
                 const bool is_formats = std::is_same_v<Member, std::vector<MeshFormat>>;
                 if (is_formats && formats == Formats::kByFiles) return;
                 if (carrier == Carrier::kQuery && !parameter.in_query) return;
                 // The volume is the command's first argument.
                 if constexpr (!std::is_same_v<Member, std::string>) {
                   options[parameter.name] = all.add(parameter, member);
                   added.push_back(parameter);
                 }
               });
  for (const Parameter& parameter : added) relate(parameter, options);
  CLI::Option* const labels = options.at("labels");
  options.at("interpolation")->excludes(labels);  // vertices of labels lie half-way
  app.parse_complete_callback([&parameters, &app, kept, labels, iso = options.at("iso")] {
    const CLI::Option* masks = app.get_option_no_throw("--masks");
    const bool are_masks = masks != nullptr && masks->count() > 0;
    if (are_masks && iso->count() > 0) throw CLI::ExcludesError("--iso", "--masks");
    if (are_masks && labels->count() == 0) parameters.labels.emplace();
    if (!are_masks && labels->count() + iso->count() == 0) {
      throw CLI::RequiredError("--iso or --labels");
    }
    if (!parameters.labels) return;
    const auto is_left_out = [&](const std::string& name) {
      return app.get_option("--" + name)->count() == 0;
    };
    const JobParameters standard = label_parameters({});
    if (is_left_out("passes")) parameters.passes = standard.passes;
    if (is_left_out("smoothing")) parameters.smoothing = standard.smoothing;
  });
}

std::string in_options(const Error& error) {
  if (error.fields().empty()) return with_options(error.what());
  std::string text;
  for (const FieldError& fault : error.fields()) {
    text += (text.empty() ? "" : "; ") + option_of_field(fault.field) + ": " +
            with_option_names(fault.message);
  }
  return text;
}

}  // namespace isomesh::cli
