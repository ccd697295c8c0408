#include "server/config_file.h"

#include <cstdint>
#include <cstdlib>
#include <istream>
#include <optional>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <toml++/toml.h>

#include "base/hex.h"
#include "base/text.h"
#include "server/wings.h"

namespace isomesh {
namespace {

enum class Kind { kFlag, kNumber, kText };

Kind kind_of(const CLI::Option& option) {
  if (option.get_expected_max() == 0) return Kind::kFlag;
  const std::string type = option.get_type_name();
  for (const std::string_view number : {"UINT", "INT", "FLOAT"}) {
    if (type.starts_with(number)) return Kind::kNumber;
  }
  return Kind::kText;
}

bool takes_many(const CLI::Option& option) { return option.get_items_expected_max() > 1; }

std::string expected_by(const CLI::Option& option) {
  const Kind kind = kind_of(option);
  if (kind == Kind::kFlag) return "must be true or false";
  if (kind == Kind::kNumber) {
    return "must be a number, or a string such as \"8GiB\" if it is a size";
  }
  return takes_many(option) ? "must be a string or a list of strings"
                            : "must be a string in quotes";
}

[[noreturn]] void refuse(const toml::source_region& place, const std::string& message) {
  throw CLI::ConfigError("line " + std::to_string(place.begin.line) + ": " + message);
}

// The value as it would be on the command line; empty if it is of another type.
std::optional<std::string> argument_of(const toml::node& value, Kind kind) {
  const auto text = value.value_exact<std::string>();
  // The library takes a flag without a text for true.
  if (text && (kind != Kind::kFlag || !text->empty())) return text;
  if (kind == Kind::kFlag) {
    if (const auto flag = value.value_exact<bool>()) return *flag ? "true" : "false";
  }
  if (kind == Kind::kNumber) {
    if (const auto number = value.value_exact<std::int64_t>()) return std::to_string(*number);
    if (const auto number = value.value_exact<double>()) return to_text(*number);
  }
  return std::nullopt;
}

std::vector<std::string> arguments_of(const toml::node& value, const CLI::Option& option) {
  const std::string& name = option.get_lnames().front();
  std::vector<std::string> arguments;
  const auto add = [&](const toml::node& each) {
    const auto argument = argument_of(each, kind_of(option));
    if (!argument) refuse(each.source(), name + ' ' + expected_by(option));
    // Names of files would end there.
    if (argument->find('\0') != std::string::npos) {
      refuse(each.source(), name + " must not have the character U+0000");
    }
    arguments.push_back(*argument);
  };
  const toml::array* list = takes_many(option) ? value.as_array() : nullptr;
  if (list == nullptr) {
    add(value);
  } else {
    for (const toml::node& each : *list) add(each);
  }
  return arguments;
}

const CLI::Option& option_of(const std::string& key, const toml::node& value, const CLI::App& cli) {
  const CLI::Option* option = cli.get_option_no_throw("--" + key);
  if (option != nullptr && option->get_configurable()) return *option;
  if (option != nullptr) {
    refuse(value.source(), '"' + key + "\" is only for the command line");
  }
  if (value.is_table() || value.is_array_of_tables()) {
    const std::string& wing = wing_entry().option;
    refuse(value.source(), "there is no section [" + key +
                               "]; this file has none, and those of a " + wing +
                               " belong in the file of --" + wing);
  }
  refuse(value.source(), "there is no option \"" + key + "\"; `isomeshd --help` lists all options");
}

// True for an empty string, as in the environment, unless the option has a default that it would
// hide.
bool is_no_value(const toml::node& value, const CLI::Option& option) {
  return value.value_exact<std::string>() == "" && option.get_default_str().empty() &&
         kind_of(option) != Kind::kFlag;
}

bool is_in_environment(const CLI::Option& option) {
  if (option.get_envname().empty()) return false;
  const char* value = std::getenv(option.get_envname().c_str());
  return value != nullptr && *value != '\0';
}

class ConfigFile : public CLI::ConfigTOML {
 public:
  explicit ConfigFile(const CLI::App& cli) : cli_(cli) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    std::vector<CLI::ConfigItem> found;
    for (const auto& [key, value] : parsed(input)) {
      const std::string name(key.str());
      const CLI::Option& option = option_of(name, value, cli_);
      std::vector<std::string> arguments = arguments_of(value, option);
      // The library has no empty list. An empty list is the default of all options that take one.
      if (arguments.empty() || is_no_value(value, option) || is_in_environment(option)) continue;
      found.push_back({{}, name, std::move(arguments)});
    }
    return found;
  }

 private:
  static toml::table parsed(std::istream& input) {
    try {
      return toml::parse(input);
    } catch (const toml::parse_error& error) {
      refuse(error.source(),
             std::string(error.description()) +
                 ". The file must be TOML, such as workers = 2 or data = \"/srv/x\"");
    }
  }

  const CLI::App& cli_;
};

// False for numbers such as 010 or 1e400, which TOML does not have.
bool is_toml_number(const std::string& value) {
  const auto whole = parse_int64(value);
  if (whole) return std::to_string(*whole) == value;
  const auto number = parse_double(value);
  const bool is_decimal = value.find_first_not_of("0123456789.") == std::string::npos;
  return number && is_decimal && value.find('.') != std::string::npos && to_text(*number) == value;
}

std::string in_toml_quotes(const std::string& value) {
  std::string text = "\"";
  for (const char c : value) {
    constexpr char kDelete = 0x7f;
    if (static_cast<unsigned char>(c) < ' ' || c == kDelete) {
      text += "\\u00" + to_hex(std::string_view(&c, 1));
      continue;
    }
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + '"';
}

}  // namespace

std::shared_ptr<CLI::Config> config_file(const CLI::App& cli) {
  return std::make_shared<ConfigFile>(cli);
}

std::string as_toml(const CLI::Option& option, const std::vector<std::string>& values) {
  const Kind kind = kind_of(option);
  if (takes_many(option) && values.size() != 1) {
    std::string list;
    for (const std::string& value : values) {
      list += (list.empty() ? "" : ", ") + in_toml_quotes(value);
    }
    return '[' + list + ']';
  }
  const std::string value = values.empty() ? "" : values.front();
  if (kind == Kind::kFlag && (value == "true" || value == "false")) return value;
  if (kind == Kind::kNumber && is_toml_number(value)) return value;
  return in_toml_quotes(value);
}

}  // namespace isomesh
