// What a program's options are, read off its table; private to this folder.
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

// "--output" and "-o".
inline std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

// The words of a value's type such as "linear|midpoint"; what is in capitals is a kind, no word.
inline std::vector<std::string> words_of(const CLI::Option& option) {
  std::vector<std::string> words;
  const std::string type = option.get_type_name();
  if (type.find('|') == std::string::npos) return words;
  for (const std::string& word : CLI::detail::split(type, '|')) {
    const auto is_plain = [](unsigned char c) {
      return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '-';
    };
    if (!word.empty() && std::ranges::all_of(word, is_plain)) words.push_back(word);
  }
  return words;
}

// Whether a value may be the path of a file or folder: CLI11 calls those TEXT unless it was told
// more.
inline bool takes_path(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.starts_with("FILE") || type.starts_with("OUT") || type.starts_with("TEXT");
}

}  // namespace isomesh::command_line
