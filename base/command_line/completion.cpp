#include "base/command_line/completion.h"

#include "base/command_line/options_of.h"

namespace isomesh::command_line {
namespace {

// % is the program's name. Candidates may be a server's words, so the scripts compare them and
// never expand them, as `compgen -W` does.
constexpr std::string_view kBash = R"sh(# bash completion of %; made by `% completion bash`.
_%() {
  local word="${COMP_WORDS[COMP_CWORD]}" program="${COMP_WORDS[0]/#\~/$HOME}" each
  local -a found
  mapfile -t found < <(command "$program" complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null | cut -f 1)
  COMPREPLY=()
  if [[ "${found[0]-}" == :files ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
    return
  fi
  for each in "${found[@]}"; do
    if [[ "$each" == "$word"* ]]; then COMPREPLY+=("$each"); fi
  done
}
complete -F _% %
)sh";

constexpr std::string_view kZsh = R"sh(#compdef %
# Made by `% completion zsh`.
_%() {
  local -a found=("${(@f)$(command ${~words[1]} complete "${(@)words[2,CURRENT]}" 2>/dev/null)}")
  if [[ "$found[1]" == :files ]]; then
    _files
  elif [[ -n "$found[1]" ]]; then
    found=("${(@)found//:/\\:}")
    found=("${(@)found/$'\t'/:}")
    _describe value found
  fi
}
_% "$@"
)sh";

constexpr std::string_view kFish = R"sh(# fish completion of %; made by `% completion fish`.
function __%_candidates
  set -l words (commandline -opc) (commandline -ct)
  set -l found (command $words[1] complete $words[2..-1] 2>/dev/null)
  if test "$found[1]" = :files
    __fish_complete_path (commandline -ct)
  else
    string join -- \n $found
  end
end
complete -c % -f -a '(__%_candidates)'
)sh";

std::string line_of(const std::string& word, const std::string& description) {
  return word + '\t' + description + '\n';
}

const CLI::Option* option_called(const std::string& name, const CLI::App* command) {
  const CLI::Option* option = nullptr;
  for (; command != nullptr && option == nullptr; command = command->get_parent()) {
    option = command->get_option_no_throw(name);
  }
  return option;
}

// The last word of a list is completed after those before it.
std::string values_of(const CLI::Option& option, const std::string& word) {
  const std::vector<std::string> words = words_of(option);
  if (words.empty()) return takes_path(option) ? std::string(kFiles) : "";
  const std::string before = is_list(option) ? word.substr(0, word.rfind(',') + 1) : "";
  std::string lines;
  for (const std::string& each : words) lines += line_of(before + each, "");
  return lines;
}

std::string option_names(const CLI::App* command) {
  std::string lines;
  for (; command != nullptr; command = command->get_parent()) {
    for (const CLI::Option* option : shown_options(*command)) {
      for (const std::string& name : names_of(*option)) {
        lines += line_of(name, option->get_description());
      }
    }
  }
  return lines;
}

}  // namespace

std::string completion_script(const std::string& program, std::string_view shell) {
  std::string script(shell == "bash"   ? kBash
                     : shell == "zsh"  ? kZsh
                     : shell == "fish" ? kFish
                                       : "");
  for (std::size_t at = 0; (at = script.find('%', at)) != std::string::npos; at += program.size()) {
    script.replace(at, 1, program);
  }
  return script;
}

Candidates candidates(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* command = &app;
  const CLI::Option* option = nullptr;  // whose value comes next
  for (std::size_t n = 0; n + 1 < words.size(); ++n) {
    if (option != nullptr) {
      option = nullptr;
    } else if (words[n].starts_with('-')) {
      option = option_called(words[n], command);
      if (option != nullptr && is_flag(*option)) option = nullptr;
    } else {
      const auto commands = shown_commands(*command);
      const auto next = std::ranges::find(commands, words[n], &CLI::App::get_name);
      if (next != commands.end()) command = *next;
    }
  }
  const std::string word = words.empty() ? "" : words.back();
  if (option != nullptr) return {values_of(*option, word), ""};
  if (word.starts_with('-')) return {option_names(command), ""};
  Candidates found;
  for (const CLI::App* each : shown_commands(*command)) {
    found.lines += line_of(each->get_name(), each->get_description());
  }
  for (const CLI::Option* each : shown_options(*command)) {
    if (each->nonpositional()) continue;
    found.operand = each->get_name(true);
    found.lines += values_of(*each, word);
    break;
  }
  if (found.lines.empty()) found.lines = kFiles;
  return found;
}

}  // namespace isomesh::command_line
