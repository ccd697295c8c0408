#include "base/command_line/manual.h"

#include <cctype>
#include <functional>
#include <sstream>
#include <string_view>

#include "base/command_line/options_of.h"

namespace isomesh::command_line {
namespace {

// Escapes text for roff, with hyphens that can be copied.
std::string plain(std::string_view text) {
  std::string escaped;
  bool begins_line = true;
  for (const char c : text) {
    if (begins_line && (c == '.' || c == '\'')) escaped += "\\&";
    begins_line = c == '\n';
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string bold(std::string_view text) { return "\\fB" + plain(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + plain(text) + "\\fR"; }

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string paragraphs(const std::string& text) {
  std::string page;
  std::istringstream lines(text);
  bool is_shown_as_is = false;
  std::string line;
  while (std::getline(lines, line)) {
    const bool is_indented = line.starts_with("  ");
    if (is_indented != is_shown_as_is) page += is_indented ? ".PP\n.nf\n" : ".fi\n.PP\n";
    is_shown_as_is = is_indented;
    page += line.empty() ? ".PP\n" : plain(line) + '\n';
  }
  return page + (is_shown_as_is ? ".fi\n" : "");
}

std::string entry(const CLI::Option& option) {
  std::string head;
  for (const std::string& name : names_of(option)) head += (head.empty() ? "" : ", ") + bold(name);
  if (!is_flag(option)) head += (head.empty() ? "" : " ") + italic(kind_of(option));
  return ".TP\n" + head + '\n' + plain(text_of(option)) + ".\n";
}

// The options of one table by their groups, in the order in which the groups first appear.
std::string options(const CLI::App& app, const std::string& heading) {
  std::string page;
  const std::vector<const CLI::Option*> all = shown_options(app);
  std::vector<std::string> groups;
  for (const CLI::Option* option : all) {
    if (std::ranges::find(groups, option->get_group()) == groups.end()) {
      groups.push_back(option->get_group());
    }
  }
  for (const std::string& group : groups) {
    page += heading + ' ' + (heading == ".SH" ? upper(group) : group) + '\n';
    for (const CLI::Option* option : all) {
      if (option->get_group() == group) page += entry(*option);
    }
  }
  return page;
}

std::string synopsis(const CLI::App& app, const std::string& program) {
  std::string line = bold(program) + " [" + italic("OPTIONS") + ']';
  const auto operand_of = [](const CLI::Option* option) {
    return option->nonpositional() ? std::string() : italic(option->get_name(true));
  };
  for (const CLI::Option* option : shown_options(app)) {
    const std::string operand = operand_of(option);
    if (!operand.empty())
      line += ' ' + operand + (option->get_items_expected_max() > 1 ? "..." : "");
  }
  return line + '\n';
}

// Calls `each` for every subcommand that has no subcommands of its own.
void visit_commands(
    const CLI::App& app, const std::string& name,
    const std::function<void(const CLI::App& command, const std::string& name)>& each) {
  for (const CLI::App* command : shown_commands(app)) {
    const std::string full = name + ' ' + command->get_name();
    if (shown_commands(*command).empty()) each(*command, full);
    visit_commands(*command, full, each);
  }
}

}  // namespace

std::string manual_page(const CLI::App& app, const Manual& manual) {
  const std::string& program = app.get_name();
  std::string page = ".TH " + upper(program) + ' ' + std::to_string(manual.number) + " \"\" \"" +
                     program + ' ' + manual.version + "\"\n.SH NAME\n" + plain(program) + " \\- " +
                     plain(manual.name) + "\n.SH SYNOPSIS\n" + synopsis(app, program);
  std::string commands;
  visit_commands(app, program, [&](const CLI::App& command, const std::string& name) {
    page += ".br\n" + synopsis(command, name);
    commands += ".SS " + plain(name) + '\n' + plain(command.get_description()) + ".\n";
    for (const CLI::Option* option : shown_options(command)) {
      if (!option->check_lname("help")) commands += entry(*option);
    }
    if (!command.get_footer().empty()) commands += ".PP\n" + paragraphs(command.get_footer());
  });
  page += ".SH DESCRIPTION\n" + plain(app.get_description()) + '\n' + options(app, ".SH");
  if (!commands.empty()) page += ".SH COMMANDS\n" + commands;
  for (const Section& section : manual.sections) {
    page += ".SH " + upper(section.title) + '\n' + paragraphs(section.text);
  }
  return page;
}

}  // namespace isomesh::command_line
