// Writes YAML in the style of openapi.yaml. Private to this folder.
#pragma once

#include <cctype>
#include <cstddef>
#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace isomesh {

// Quotes a word that YAML 1.1, and so PyYAML, reads as true or false.
inline std::string yaml_word(const std::string& word) {
  for (const char* const truth : {"on", "off", "yes", "no", "y", "n"}) {
    if (word == truth) return '"' + word + '"';
  }
  return word;
}

// The items of a list or a mapping, without its brackets.
inline std::string with_commas(const std::vector<std::string>& items) {
  std::string text;
  for (const std::string& item : items) {
    if (!text.empty()) text += ", ";
    text += yaml_word(item);
  }
  return text;
}

inline std::string in_brackets(const std::vector<std::string>& items) {
  return '[' + with_commas(items) + ']';
}

// Lines of YAML, each indented by its depth.
class Yaml {
 public:
  static constexpr std::size_t kWidth = 104;

  explicit Yaml(std::size_t depth) : depth_(depth) {}

  void line(const std::string& text) { text_ += std::string(2 * depth_, ' ') + text + '\n'; }

  // Writes `name:` and the lines of `inner` below it.
  void under(const std::string& name, const std::function<void()>& inner) {
    line(name + ':');
    ++depth_;
    inner();
    --depth_;
  }

  // Writes a text of any length, on the name's own line if it is short and needs no quoting.
  void text(const std::string& name, const std::string& value) {
    const bool is_plain = std::isalpha(static_cast<unsigned char>(value.front())) != 0 &&
                          value.find(": ") == std::string::npos &&
                          value.find(" #") == std::string::npos;
    if (is_plain && 2 * depth_ + name.size() + 2 + value.size() <= kWidth) {
      return line(name + ": " + value);
    }
    line(name + ": |");
    ++depth_;
    wrapped(value);
    --depth_;
  }

  const std::string& str() const { return text_; }

 private:
  void wrapped(const std::string& value) {
    std::istringstream words(value);
    std::string row;
    for (std::string word; words >> word;) {
      if (!row.empty() && 2 * depth_ + row.size() + 1 + word.size() > kWidth) {
        line(std::exchange(row, {}));
      }
      row += (row.empty() ? "" : " ") + word;
    }
    line(row);
  }

  std::size_t depth_;
  std::string text_;
};

}  // namespace isomesh
