#include "base/command_line/completion.h"

#include <functional>

#include "base/command_line/options_of.h"

namespace isomesh::command_line {
namespace {

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

// Quotes text for a shell; `quote` is that shell's escape for a single quote.
std::string quoted(std::string_view text, std::string_view quote) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') {
      result += quote;
    } else {
      result += c;
    }
  }
  return result + '\'';
}

// A command's options. For a subcommand they include those of its own subcommands.
std::vector<const CLI::Option*> all_options(const CLI::App& app) {
  std::vector<const CLI::Option*> options = shown_options(app);
  if (app.get_parent() == nullptr) return options;
  for (const CLI::App* command : shown_commands(app)) {
    for (const CLI::Option* option : shown_options(*command)) {
      if (!option->check_lname("help")) options.push_back(option);
    }
  }
  return options;
}

std::vector<std::string> all_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : all_options(app)) {
    for (const std::string& name : names_of(*option)) names.push_back(name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : shown_commands(app)) names.push_back(command->get_name());
  return names;
}

// Calls `each` for the program's own table, then for each subcommand's.
void visit(const CLI::App& app, const std::function<void(const CLI::App&)>& each) {
  each(app);
  for (const CLI::App* command : shown_commands(app)) each(*command);
}

// The positional whose values complete a command's arguments, if a shell can know them.
struct Operand {
  std::string name = {};
  std::vector<std::string> words = {};
  std::string listing = {};  // a shell command that prints the values
};

Operand operand_of(const CLI::App& command, const std::string& program, const Listings& listings) {
  for (const CLI::Option* option : shown_options(command)) {
    if (option->nonpositional()) continue;
    Operand operand{.name = option->get_name(true), .words = words_of(*option)};
    if (const auto found = listings.find(operand.name); found != listings.end()) {
      operand.listing = program + ' ' + found->second + " 2>/dev/null";
    }
    return operand;
  }
  return {};
}

// --- bash ----------------------------------------------------------------------------------------

// The cases that complete an option's value. Options of one name in several subcommands share the
// first one's case.
std::string bash_values(const CLI::App& app) {
  std::string cases;
  std::vector<std::string> seen;
  visit(app, [&](const CLI::App& table) {
    for (const CLI::Option* option : all_options(table)) {
      const std::vector<std::string> names = names_of(*option);
      if (is_flag(*option) || names.empty() || std::ranges::count(seen, names.back()) > 0) continue;
      seen.push_back(names.back());
      const std::vector<std::string> words = words_of(*option);
      const std::string list = '\'' + joined(words, " ") + '\'';
      cases += "    " + joined(names, "|") + ")\n      COMPREPLY=(" +
               (is_list(*option) && !words.empty()
                    ? "$(compgen -P \"${word%\"${word##*,}\"}\" -W " + list + " -- \"${word##*,}\")"
                : !words.empty()      ? "$(compgen -W " + list + " -- \"$word\")"
                : takes_path(*option) ? "$(compgen -f -- \"$word\")"
                                      : "") +
               ")\n      return ;;\n";
    }
  });
  return cases;
}

std::string with_name(std::string script, const std::string& name) {
  for (std::size_t at = 0; (at = script.find('%', at)) != std::string::npos; at += name.size()) {
    script.replace(at, 1, name);
  }
  return script;
}

std::string for_bash(const CLI::App& app, const Listings& listings) {
  const std::string name = app.get_name();
  std::string cases;
  for (const CLI::App* command : shown_commands(app)) {
    const Operand operand = operand_of(*command, name, listings);
    std::vector<std::string> own = command_names(*command);
    own.insert(own.end(), operand.words.begin(), operand.words.end());
    cases += "    " + command->get_name() + ")\n      names+=' " +
             joined(all_names(*command), " ") + "'\n      words='" + joined(own, " ") + "'";
    if (!operand.listing.empty()) {
      cases += "\n      [[ \"$word\" == -* ]] || words+=\" $(" + operand.listing + ")\"";
    }
    cases += " ;;\n";
  }
  return with_name(R"(# bash completion of %; made by `% completion bash`.
_%() {
  local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" command= at names words
  COMPREPLY=()
  case "$before" in
)",
                   name) +
         bash_values(app) +
         R"(  esac
  for ((at = 1; at < COMP_CWORD; ++at)); do
    case "${COMP_WORDS[at]}" in
      )" +
         joined(command_names(app), "|") +
         R"() command="${COMP_WORDS[at]}"; break ;;
    esac
  done
  names=')" +
         joined(all_names(app), " ") + "'\n  case \"$command\" in\n    '') words='" +
         joined(command_names(app), " ") + "' ;;\n" + cases +
         with_name(R"(  esac
  if [[ "$word" == -* ]]; then
    COMPREPLY=($(compgen -W "$names" -- "$word"))
  elif [[ -n "$words" ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$word"))
  else
    COMPREPLY=($(compgen -f -- "$word"))
  fi
}
complete -o filenames -F _% %
)",
                   name);
}

// --- zsh -----------------------------------------------------------------------------------------

std::string zsh_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == ':' || c == '[' || c == ']' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

// Makes one argument of _arguments for each name: '--iso[The iso-value]:N:'.
std::string zsh_options(const CLI::App& app) {
  std::string lines;
  for (const CLI::Option* option : all_options(app)) {
    for (const std::string& name : names_of(*option)) {
      std::string entry = "*" + name + "[" + zsh_text(option->get_description()) + "]";
      if (!is_flag(*option)) {
        const std::vector<std::string> words = words_of(*option);
        entry += ":" + zsh_text(option->get_type_name()) + ":" +
                 (!words.empty() && is_list(*option) ? "_values -s , value " + joined(words, " ")
                  : !words.empty()                   ? "(" + joined(words, " ") + ")"
                  : takes_path(*option)              ? "_files"
                                                     : "");
      }
      lines += "    " + quoted(entry, "'\\''") + " \\\n";
    }
  }
  return lines;
}

// The _arguments entry for positionals and subcommands.
std::string zsh_operands(const CLI::App& command, const Operand& operand) {
  std::vector<std::string> own = command_names(command);
  own.insert(own.end(), operand.words.begin(), operand.words.end());
  if (!own.empty()) return "'1:word:(" + joined(own, " ") + ")' '*:file:_files'";
  if (operand.listing.empty()) return "'*:file:_files'";
  return "'*:" + operand.name + ":{compadd -- $(" + operand.listing + ")}'";
}

std::string for_zsh(const CLI::App& app, const Listings& listings) {
  const std::string name = app.get_name();
  std::string script = "#compdef " + name + "\n# Made by `" + name + " completion zsh`.\n\n";
  for (const CLI::App* command : shown_commands(app)) {
    script += "_" + name + "_" + command->get_name() + "() {\n  _arguments \\\n" +
              zsh_options(*command) + zsh_options(app) + "    " +
              zsh_operands(*command, operand_of(*command, name, listings)) + "\n}\n\n";
  }
  script += "_" + name + "() {\n  local line state\n  _arguments -C \\\n" + zsh_options(app) +
            "    '1:command:->command' '*::argument:->arguments'\n  case $state in\n"
            "    command)\n      local -a commands=(\n";
  for (const CLI::App* command : shown_commands(app)) {
    script += "        " +
              quoted(command->get_name() + ":" + zsh_text(command->get_description()), "'\\''") +
              '\n';
  }
  return script + "      )\n      _describe command commands ;;\n    arguments) _" + name +
         "_${line[1]} ;;\n  esac\n}\n\n_" + name + " \"$@\"\n";
}

// --- fish ----------------------------------------------------------------------------------------

std::string fish_options(const CLI::App& app, const std::string& begin) {
  std::string lines;
  for (const CLI::Option* option : all_options(app)) {
    if (names_of(*option).empty()) continue;
    std::string line = begin;
    for (const std::string& name : option->get_snames()) line += " -s " + name;
    for (const std::string& name : option->get_lnames()) line += " -l " + name;
    if (!is_flag(*option)) {
      const std::vector<std::string> words = words_of(*option);
      line += takes_path(*option) ? " -r -F" : " -x";
      if (!words.empty()) line += " -a '" + joined(words, " ") + "'";
    }
    lines += line + " -d " + quoted(option->get_description(), "\\'") + '\n';
  }
  return lines;
}

std::string for_fish(const CLI::App& app, const Listings& listings) {
  const std::string name = app.get_name();
  const std::string complete = "complete -c " + name;
  const std::string commands = joined(command_names(app), " ");
  std::string script =
      "# fish completion of " + name + "; made by `" + name + " completion fish`.\n";
  script += fish_options(app, complete);
  for (const CLI::App* command : shown_commands(app)) {
    script += complete + " -f -n 'not __fish_seen_subcommand_from " + commands + "' -a " +
              command->get_name() + " -d " + quoted(command->get_description(), "\\'") + '\n';
    const Operand operand = operand_of(*command, name, listings);
    std::vector<std::string> own = command_names(*command);
    own.insert(own.end(), operand.words.begin(), operand.words.end());
    if (!operand.listing.empty()) own.push_back('(' + operand.listing + ')');
    if (!own.empty()) {
      script += complete + " -f -n '__fish_seen_subcommand_from " + command->get_name() + "' -a '" +
                joined(own, " ") + "'\n";
    }
    script += fish_options(
        *command, complete + " -n '__fish_seen_subcommand_from " + command->get_name() + "'");
  }
  return script;
}

}  // namespace

std::optional<Shell> shell_from(std::string_view name) {
  if (name == "bash") return Shell::kBash;
  if (name == "zsh") return Shell::kZsh;
  if (name == "fish") return Shell::kFish;
  return std::nullopt;
}

std::string completion(const CLI::App& app, Shell shell, const Listings& listings) {
  switch (shell) {
    case Shell::kBash:
      return for_bash(app, listings);
    case Shell::kZsh:
      return for_zsh(app, listings);
    case Shell::kFish:
      return for_fish(app, listings);
  }
  return {};
}

}  // namespace isomesh::command_line
