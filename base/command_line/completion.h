// Shell completion of a program's arguments, from its own table of options.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace isomesh::command_line {

// A script for the shell (bash, zsh or fish); empty for another one. It calls `PROGRAM complete
// WORDS..` whenever it completes.
std::string completion_script(const std::string& program, std::string_view shell);

struct Candidates {
  // To be printed: candidates with their descriptions, each on a line, with a tab between them; or
  // kFiles if files are candidates.
  std::string lines;
  // The name of the positional that is completed, whose values only the program may know.
  std::string operand;
};

inline constexpr std::string_view kFiles = ":files\n";

// `words` are the arguments up to the cursor; the last one, which may be empty, is completed.
// Options and subcommands without a group are omitted.
Candidates candidates(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace isomesh::command_line
