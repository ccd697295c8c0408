// Reads a program's options from its table; private to this folder.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace isomesh::command_line {

// Options and subcommands without a group are not shown.
inline std::vector<const CLI::Option*> shown_options(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return !option->get_group().empty(); });
}

inline std::vector<const CLI::App*> shown_commands(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

inline bool is_flag(const CLI::Option& option) { return option.get_expected_max() == 0; }

inline std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

// True for a list such as "drc|stl,..": its words are separated by commas.
inline bool is_list(const CLI::Option& option) { return option.get_type_name().ends_with(",.."); }

// The words of a value's type such as "linear|midpoint". Capitals name a kind of value instead.
inline std::vector<std::string> words_of(const CLI::Option& option) {
  std::vector<std::string> words;
  std::string type = option.get_type_name();
  if (type.find('|') == std::string::npos) return words;
  if (is_list(option)) type.resize(type.size() - 3);
  for (const std::string& word : CLI::detail::split(type, '|')) {
    const auto is_plain = [](unsigned char c) {
      return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '-';
    };
    if (!word.empty() && std::ranges::all_of(word, is_plain)) words.push_back(word);
  }
  return words;
}

// True if a value may be the path of a file or folder. CLI11's own name for those is TEXT.
inline bool takes_path(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.starts_with("FILE") || type.starts_with("OUT") || type.starts_with("TEXT");
}

// "UINT" of "UINT:INT in [1 - 64]": the kind of the value. `text_of` has the range.
inline std::string kind_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (option.nonpositional()) return type.substr(0, type.find(':'));
  return option.get_name(true);
}

// The description with the range, the default and the environment's variable.
inline std::string text_of(const CLI::Option& option) {
  std::string text = option.get_description();
  const std::string type = option.get_type_name();
  const std::size_t range = type.find(" in [");
  if (range != std::string::npos) text += "; within " + type.substr(range + 4);
  const std::string standard = option.get_default_str();
  if (!is_flag(option) && !standard.empty()) text += " (default: " + standard + ")";
  if (!option.get_envname().empty()) text += ". Environment: " + option.get_envname();
  return text;
}

}  // namespace isomesh::command_line
