// What shells complete a program's arguments with, made of its own table of options.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace isomesh::command_line {

enum class Shell { kBash, kZsh, kFish };

// Of "bash", "zsh" or "fish".
std::optional<Shell> shell_from(std::string_view name);

// A script for that shell: subcommands, the options of each, the words that a value may be, and
// files where a value is one. What belongs to no group is left out.
std::string completion(const CLI::App& app, Shell shell);

}  // namespace isomesh::command_line
