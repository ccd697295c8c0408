// The file of --config: TOML, with one key per option.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class Config;
class Option;
}  // namespace CLI

namespace isomesh {

// Reads such a file, for CLI::App::config_formatter. It omits options that the environment sets: in
// CLI11 the file overrides the environment, but variables of a container or a unit should change
// an installed configuration. Throws CLI::ConfigError, with the line, for anything but known keys
// with values of their type. `cli` must outlive the result.
std::shared_ptr<CLI::Config> config_file(const CLI::App& cli);

// An option's values as TOML: one, or a list if it is an option that takes several. Such a file
// reads them as the same values if they are UTF-8, as all TOML is.
std::string as_toml(const CLI::Option& option, const std::vector<std::string>& values);

}  // namespace isomesh
