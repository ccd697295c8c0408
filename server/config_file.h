// The file of --config: TOML, with one key per option.
#pragma once

#include <memory>
#include <string>

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

// An option's value as TOML. Such a file reads it as the same value if it is UTF-8, as all TOML is.
std::string as_toml(const CLI::Option& option, const std::string& value);

}  // namespace isomesh
