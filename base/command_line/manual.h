// A program's manual page, made of its own table of options.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace isomesh::command_line {

struct Section {
  std::string title;
  // Paragraphs, with a blank line between them. One whose lines begin with two blanks is shown as
  // it is.
  std::string text;
};

struct Manual {
  int number = 1;       // of the part of the manual
  std::string version;  // of the program
  std::string name;     // what the program does, as `whatis` tells it: no capital, no full stop
  std::vector<Section> sections;  // after the options
};

// The page in roff's man macros (man(7)): options by their groups, and each subcommand with its
// own. What belongs to no group is left out. Throws nothing but what strings throw.
std::string manual_page(const CLI::App& app, const Manual& manual);

}  // namespace isomesh::command_line
