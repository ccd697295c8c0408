// Reads the tables of the configuration file.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <toml++/toml.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh::orders {

// Throws Error kInvalidParameter.
[[noreturn]] inline void refuse(const std::string& key, const std::string& message) {
  throw invalid_parameter(key, message);
}

// A table of the file. Keys that remain after all known ones were read are errors.
class Section {
 public:
  Section(const toml::table& table, std::string name) : table_(table), name_(std::move(name)) {}

  std::string key_of(std::string_view key) const {
    return name_.empty() ? std::string(key) : name_ + '.' + std::string(key);
  }

  const toml::node* find(std::string_view key) {
    known_.emplace(key);
    return table_.get(key);
  }

  void read(std::string_view key, std::string& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto text = node->value_exact<std::string>();
    if (!text || has_control_characters(*text)) refuse(key_of(key), "must be a string on one line");
    value = *text;
  }

  void read(std::string_view key, std::filesystem::path& value) {
    std::string text;
    read(key, text);
    if (!text.empty()) value = text;
  }

  void read(std::string_view key, bool& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto flag = node->value_exact<bool>();
    if (!flag) refuse(key_of(key), "must be true or false");
    value = *flag;
  }

  template <class Number>
  requires(std::is_integral_v<Number> &&
           !std::is_same_v<Number, bool>) void read(std::string_view key, Number& value,
                                                    std::int64_t low, std::int64_t high) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto number = node->value_exact<std::int64_t>();
    if (!number || *number < low || *number > high) {
      refuse(key_of(key),
             "must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
    }
    value = static_cast<Number>(*number);
  }

  void read(std::string_view key, std::chrono::seconds& value, std::int64_t low,
            std::int64_t high) {
    std::int64_t count = value.count();
    read(key, count, low, high);
    value = std::chrono::seconds(count);
  }

  // Reads a number of millimetres greater than 0.
  void read(std::string_view key, std::optional<double>& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    value = node->is_number() ? node->value<double>() : std::nullopt;
    if (!value || !std::isfinite(*value) || !(*value > 0)) {
      refuse(key_of(key), "must be a number above 0");
    }
  }

  void read(std::string_view key, std::vector<std::string>& values) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const toml::array* list = node->as_array();
    if (list == nullptr) refuse(key_of(key), "must be a list of strings");
    for (const toml::node& each : *list) {
      const auto text = each.value_exact<std::string>();
      if (!text) refuse(key_of(key), "must be a list of strings");
      values.push_back(*text);
    }
  }

  // Empty if the section is missing.
  std::optional<Section> section(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const toml::table* table = node->as_table();
    if (table == nullptr) refuse(key_of(key), "must be a table");
    return Section(*table, key_of(key));
  }

  std::vector<Section> sections(std::string_view key) {
    std::vector<Section> all;
    const toml::node* node = find(key);
    if (node == nullptr) return all;
    const toml::array* list = node->as_array();
    if (list == nullptr) refuse(key_of(key), "must be a list of tables");
    for (std::size_t i = 0; i < list->size(); ++i) {
      const toml::table* table = list->get(i)->as_table();
      if (table == nullptr) refuse(key_of(key), "must be a list of tables");
      all.emplace_back(*table, key_of(key) + '[' + std::to_string(i) + ']');
    }
    return all;
  }

  const toml::table& table() const { return table_; }

  void require(std::string_view key, const std::string& value) const {
    if (value.empty()) refuse(key_of(key), "is required");
  }

  // Call after reading all known keys.
  void finish() const {
    for (const auto& [key, unused] : table_) {
      if (!known_.contains(key.str())) refuse(key_of(key.str()), "is not a known key");
    }
  }

 private:
  const toml::table& table_;
  std::string name_;
  std::set<std::string, std::less<>> known_;
};

}  // namespace isomesh::orders
