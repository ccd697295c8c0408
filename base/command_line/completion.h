// Shell completion of a program's arguments, generated from its own table of options.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace isomesh::command_line {

enum class Shell { kBash, kZsh, kFish };

std::optional<Shell> shell_from(std::string_view name);

// Arguments by which the program prints the values of a positional, one per line, by the name of
// the positional: {"JOB", "ids jobs"}.
using Listings = std::map<std::string, std::string>;

// Returns a script for the shell. It completes subcommands, their options, enumerated values,
// files, and the positionals in `listings`. Options and subcommands without a group are omitted.
std::string completion(const CLI::App& app, Shell shell, const Listings& listings = {});

}  // namespace isomesh::command_line
