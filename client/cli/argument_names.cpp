#include <cctype>
#include <string_view>

#include <CLI/CLI.hpp>

#include "base/command_line/closest.h"
#include "client/cli/option_groups.h"

namespace isomesh::cli {
namespace {

[[noreturn]] void unknown(const std::string& what, const std::string& name,
                          const std::vector<std::string>& names, const std::string& help) {
  const std::string close = command_line::closest_to(name, names);
  wrong_usage("there is no " + what + ' ' + name +
              (close.empty() ? "" : ". Did you mean " + close + '?') + "\n`" + help +
              " --help` lists the " + what + 's');
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

const CLI::App& command_called(const std::string& name, const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* each : commands_of(app)) {
    if (each->check_name(name)) return *each;
    if (!each->get_group().empty()) names.push_back(each->get_name());
  }
  unknown("command", name, names, "isomesh");
}

const CLI::Option& option_called(const std::string& name, const CLI::App& command,
                                 const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* table : {&command, &app}) {
    if (const CLI::Option* option = table->get_option_no_throw(name)) return *option;
    for (const CLI::Option* option : table->get_options()) {
      for (const std::string& each : option->get_lnames()) names.push_back("--" + each);
    }
  }
  unknown("option", name, names, &command == &app ? "isomesh" : "isomesh " + command.get_name());
}

bool is_option(std::string_view word) {
  return word.starts_with("--") || (word.size() == 2 && word[0] == '-' &&
                                    std::isalpha(static_cast<unsigned char>(word[1])) != 0);
}

}  // namespace

void check_names(const CLI::App& app, int argc, const char* const* argv) {
  const CLI::App* command = &app;
  std::string server;  // the option that names one
  for (int n = 1; n < argc && std::string_view(argv[n]) != "--"; ++n) {
    const std::string word = argv[n];
    if (!is_option(word)) {
      if (command == &app && !word.starts_with('-')) command = &command_called(word, app);
      continue;
    }
    const std::string name = word.substr(0, word.find('='));
    const CLI::Option& option = option_called(name, *command, app);
    if (name == "--server" || name == "--token" || name == "--ca") server = name;
    const bool has_value_behind = option.get_items_expected_max() > 0 && name.size() == word.size();
    if (has_value_behind) ++n;
  }
  if (command->get_name() == "local" && !server.empty()) {
    wrong_usage(server +
                " does not apply to `isomesh local`, which uses no server; use `isomesh mesh`");
  }
}

}  // namespace isomesh::cli
