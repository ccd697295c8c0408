// A program's manual page, generated from its own table of options.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace isomesh::command_line {

struct Section {
  std::string title;
  // Paragraphs, with a blank line between them. Lines that begin with two blanks are not wrapped.
  std::string text;
};

struct Manual {
  int number = 1;  // the section of the manual
  std::string version;
  std::string name;  // what the program does, for `whatis`: no capital, no full stop
  std::vector<Section> sections;
};

// The page in roff's man macros (man(7)): options by their groups, and each subcommand with its own
// options and its footer. Options and subcommands without a group are omitted.
std::string manual_page(const CLI::App& app, const Manual& manual);

}  // namespace isomesh::command_line
