#include "base/command_line/help.h"

#include <sstream>

#include <CLI/CLI.hpp>

#include "base/command_line/options_of.h"

namespace isomesh::command_line {
namespace {

constexpr std::size_t kColumns = 80;
constexpr std::size_t kTextColumn = 30;

// Two columns, or the text on a line of its own if the first column is too long.
std::string entry(const std::string& head, const std::string& text) {
  std::string line = "  " + head;
  if (line.size() + 2 > kTextColumn) line += '\n' + std::string(kTextColumn, ' ');
  if (line.size() < kTextColumn) line.resize(kTextColumn, ' ');
  return line + wrapped(text, kTextColumn, kTextColumn) + '\n';
}

class WrappedHelp : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string head = is_positional ? option->get_name(true, false) : joined_names(*option);
    if (!is_positional && !is_flag(*option)) head += ' ' + kind_of(*option);
    return entry(head, text_of(*option));
  }

  std::string make_subcommand(const CLI::App* command) const override {
    return entry(command->get_display_name(true), command->get_description());
  }

  std::string make_description(const CLI::App* app) const override {
    return app->get_description().empty() ? "" : wrapped(app->get_description(), 0) + '\n';
  }

  // The footer is not wrapped, because it contains commands.
  std::string make_footer(const CLI::App* app) const override {
    const std::string footer = app->get_footer();
    if (app->get_parent() == nullptr) return footer.empty() ? "" : footer + '\n';
    const CLI::App* program = app->get_parent();
    while (program->get_parent() != nullptr) program = program->get_parent();
    return footer + (footer.empty() ? "" : "\n") + '`' + program->get_name() +
           " --help` lists the options of all commands.\n";
  }

 private:
  static std::string joined_names(const CLI::Option& option) {
    std::string names;
    for (const std::string& name : names_of(option)) names += (names.empty() ? "" : ", ") + name;
    return names;
  }
};

}  // namespace

std::string wrapped(std::string_view text, std::size_t indent, std::size_t begin) {
  std::string result;
  std::size_t column = begin;
  bool is_first_line = true;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line); is_first_line = false) {
    if (!is_first_line) {
      result += '\n' + std::string(indent, ' ');
      column = indent;
    }
    std::istringstream words(line);
    bool begins_line = true;
    for (std::string word; words >> word; begins_line = false) {
      if (!begins_line && column + 1 + word.size() > kColumns) {
        result += '\n' + std::string(indent, ' ');
        column = indent;
        begins_line = true;
      }
      if (!begins_line) result += ' ';
      column += word.size() + (begins_line ? 0 : 1);
      result += word;
    }
  }
  return result;
}

std::shared_ptr<CLI::FormatterBase> wrapped_help() { return std::make_shared<WrappedHelp>(); }

}  // namespace isomesh::command_line
