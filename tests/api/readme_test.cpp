// The tables in docs/ are what the programs say.
#include <filesystem>
#include <regex>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "proto/notes.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh {
namespace {

using namespace test;

// Of "  --workers UINT:INT in [1 - 64]=2" or, of CLI11 2.4, "  --workers UINT:INT in [1 - 64] [2]".
std::string default_of(const std::string& option) {
  static const std::regex form(R"((?:=|(?:[A-Z]|\]) \[)([^=\[\]()]+)\]?$)");
  std::smatch found;
  return std::regex_search(option, found, form) ? '`' + found[1].str() + '`' : "";
}

// The rows of the table, as Markdown.
std::string table_of(const std::string& help) {
  std::istringstream lines(help);
  std::string table;
  std::string line;
  while (std::getline(lines, line)) {
    const std::size_t begin = line.find_first_not_of(' ');
    if (begin == std::string::npos || !line.substr(begin).starts_with("--")) continue;
    const std::string name = line.substr(begin, line.find_first_of(" \n", begin) - begin);
    if (name == "--version" || name == "--config") continue;
    // Beside a short name, or on the next line.
    const std::size_t variable = line.find(" (Env:");
    const std::size_t beside = line.find("  ", begin);
    const bool is_beside = variable == std::string::npos && beside != std::string::npos;
    std::string meaning = is_beside ? line.substr(beside) : "";
    std::string option = line.substr(0, is_beside ? beside : variable);
    option.erase(option.find_last_not_of(' ') + 1);
    if (meaning.empty()) std::getline(lines, meaning);
    meaning.erase(0, meaning.find_first_not_of(' '));
    table += "| `" + name + "` | " + default_of(option) + " | " + meaning + " |\n";
  }
  return table;
}

TEST(Docs, TheirTableOfOptionsIsTheHelpsOwn) {
  const Finished help = run({ISOMESHD, "--help"});
  ASSERT_EQ(help.status, 0);
  const std::string table = table_of(help.output);
  ASSERT_NE(table.find("| `--workers` | `2` |"), std::string::npos) << table;
  const auto docs = std::filesystem::path(ISOMESH_README).parent_path() / "docs/operating.md";
  EXPECT_NE(read_file(docs).find("|---|---|---|\n" + table + '\n'), std::string::npos)
      << "docs/operating.md must hold these rows and no others:\n"
      << table;
}

// So that a new note is told of there too.
TEST(Docs, TheirTableOfNotesIsThatOfTheProgram) {
  std::string table = "| code | in meshes | meaning |\n|---|---|---|\n";
  for (const NoteDescription& note : note_descriptions()) {
    table += "| `" + std::string(note.name) + "` | " + (note.is_in_mesh ? "yes" : "") + " | " +
             std::string(note.meaning) + " |\n";
  }
  const auto docs = std::filesystem::path(ISOMESH_README).parent_path() / "docs/uploads.md";
  EXPECT_TRUE(read_file(docs).ends_with(table)) << "docs/uploads.md must end with:\n" << table;
}

}  // namespace
}  // namespace isomesh
