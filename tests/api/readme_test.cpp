// README and docs/ agree with the programs and with each other.
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/notes.h"
#include "proto/types.h"
#include "proto/volume_formats.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

const std::filesystem::path kReadme = ISOMESH_README;
const std::filesystem::path kDocs = kReadme.parent_path() / "docs";

// README and the files of docs/, without its decisions.
std::vector<std::filesystem::path> documents() {
  std::vector<std::filesystem::path> found = {kReadme};
  for (const auto& entry : std::filesystem::directory_iterator(kDocs)) {
    if (entry.path().extension() == ".md") found.push_back(entry.path());
  }
  return found;
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::istringstream text(read_file(file));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

// As GitHub names the anchor of a heading: lower case, hyphens for blanks, no punctuation.
std::string anchor_of(std::string_view heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '-' || c == '_') {
      anchor += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

std::set<std::string> anchors_in(const std::filesystem::path& file) {
  std::set<std::string> anchors;
  for (const std::string& line : lines_of(file)) {
    const std::size_t text = line.find_first_not_of('#');
    if (text == 0 || text == std::string::npos || line[text] != ' ') continue;
    anchors.insert(anchor_of(std::string_view(line).substr(text + 1)));
  }
  return anchors;
}

// The long options in a text, without their values.
std::set<std::string> options_in(const std::string& text) {
  static const std::regex form(R"((?:^|[\s\[,])(--[a-z][a-z0-9-]*))");
  std::set<std::string> options;
  for (std::sregex_iterator found(text.begin(), text.end(), form), end; found != end; ++found) {
    options.insert((*found)[1]);
  }
  return options;
}

std::string help_of(const std::vector<std::string>& command) {
  static std::map<std::vector<std::string>, std::string> known;
  const auto [found, is_new] = known.try_emplace(command);
  if (is_new) {
    std::vector<std::string> asking = command;
    asking.emplace_back("--help");
    const Finished help = run(asking);
    EXPECT_EQ(help.status, 0) << command.back() << ": " << help.errors;
    found->second = help.output;
  }
  return found->second;
}

// The programs that a shown line runs, each with its subcommand and the rest of the line.
struct ShownCommand {
  std::vector<std::string> program;
  std::string arguments;
};

std::vector<ShownCommand> commands_in(const std::string& line) {
  static const std::regex form(R"re((?:^ {4}|[|(] ?)(isomeshd?)( [a-z]+)?(?= |$)([^|()#]*))re");
  std::vector<ShownCommand> commands;
  for (std::sregex_iterator found(line.begin(), line.end(), form), end; found != end; ++found) {
    const std::smatch& match = *found;
    ShownCommand command{{match[1] == "isomesh" ? ISOMESH : ISOMESHD}, match[3]};
    if (match[2].matched) command.program.push_back(match[2].str().substr(1));
    if (match[2] == " token") {
      const std::size_t end_of_verb = command.arguments.find(' ', 1);
      command.program.push_back(command.arguments.substr(1, end_of_verb - 1));
    }
    commands.push_back(std::move(command));
  }
  return commands;
}

// An option of the help: its name and its text, whose lines are joined.
struct HelpEntry {
  std::string name;
  std::string text;
};

// The help has names in the first columns, and texts beside them or, below a long name, on the next
// line.
std::vector<HelpEntry> entries_of(const std::string& help) {
  constexpr std::size_t kTextColumn = 30;
  static const std::regex name("^  (?:-[a-zA-Z], ?)?(--[a-z-]+).*");
  std::istringstream lines(help);
  std::vector<HelpEntry> entries;
  std::string line;
  bool is_option = false;  // and not of the list of subcommands
  while (std::getline(lines, line)) {
    std::smatch found;
    const bool continues = line.starts_with(std::string(kTextColumn, ' '));
    if (!continues) is_option = std::regex_match(line, found, name);
    if (!is_option) continue;
    if (!continues) entries.push_back({found[1], ""});
    const bool has_text = line.size() > kTextColumn && line.compare(kTextColumn - 2, 2, "  ") == 0;
    if (!has_text) continue;
    std::string& text = entries.back().text;
    text += (text.empty() ? "" : " ") + line.substr(kTextColumn);
  }
  return entries;
}

// The rows of the table, as Markdown: without what a value must be and the variable of the
// environment.
std::string table_of(const std::string& help) {
  static const std::regex form(
      R"((.*?)(?:; within \[[^\]]*\])?(?: \(default: ([^)]*)\))?\.?(?: Environment: \w+)?)");
  std::string table;
  for (const HelpEntry& entry : entries_of(help)) {
    if (entry.name == "--version" || entry.name == "--config" || entry.name == "--help") continue;
    std::smatch found;
    std::regex_match(entry.text, found, form);
    const std::string standard = found[2].matched ? '`' + found[2].str() + '`' : "";
    table += "| `" + entry.name + "` | " + standard + " | " + found[1].str() + " |\n";
  }
  return table;
}

TEST(Docs, TheirTableOfOptionsIsTheHelpsOwn) {
  const Finished help = run({ISOMESHD, "--help"});
  ASSERT_EQ(help.status, 0);
  const std::string table = table_of(help.output);
  ASSERT_NE(table.find("| `--workers` | `2` |"), std::string::npos) << table;
  EXPECT_NE(read_file(kDocs / "operating.md").find("|---|---|---|\n" + table + '\n'),
            std::string::npos)
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
  EXPECT_TRUE(read_file(kDocs / "uploads.md").ends_with(table))
      << "docs/uploads.md must end with:\n"
      << table;
}

// So that a new format is told of there too.
TEST(Docs, TheirTableOfFormatsIsThatOfTheProgram) {
  std::string table = "| format | files | what is read |\n|---|---|---|\n";
  for (const VolumeFormat& format : volume_formats()) {
    std::string files = std::string(format.suffixes);
    for (std::size_t at = files.find(' '); at != std::string::npos; at = files.find(' ', at + 3)) {
      files.replace(at, 1, "` `");
    }
    table += "| " + std::string(format.title) + " | `" + files + "` | " +
             std::string(format.content) + " |\n";
  }
  EXPECT_NE(read_file(kDocs / "uploads.md").find(table + '\n'), std::string::npos)
      << "docs/uploads.md must hold these rows and no others:\n"
      << table;
}

TEST(Docs, TheReadmeFitsThreeScreensAndSaysWhatItMust) {
  constexpr std::size_t kMostLines = 150;
  EXPECT_LE(lines_of(kReadme).size(), kMostLines);
  const std::string readme = read_file(kReadme);
  for (const char* words : {"not a medical device", "\n    client/demo\n", "\n    tests/run\n",
                            "\n## Build it\n", "\n## Install\n", "\n## Licence\n"}) {
    EXPECT_THAT(readme, HasSubstr(words));
  }
  EXPECT_EQ(readme.find("!["), readme.rfind("![")) << "one picture is enough";
}

TEST(Docs, EveryLinkLeadsToAFileAndItsHeading) {
  static const std::regex form(R"(\]\(([^)#]*)(?:#([^)]*))?\))");
  std::size_t links = 0;
  for (const auto& document : documents()) {
    const std::string text = read_file(document);
    for (std::sregex_iterator found(text.begin(), text.end(), form), end; found != end; ++found) {
      const std::string path = (*found)[1];
      if (path.find("://") != std::string::npos) continue;
      ++links;
      const auto target = path.empty() ? document : document.parent_path() / path;
      ASSERT_TRUE(std::filesystem::exists(target)) << document << " links to " << path;
      if (!(*found)[2].matched) continue;
      EXPECT_TRUE(anchors_in(target).contains((*found)[2]))
          << document << " links to a heading that " << target << " lacks: " << (*found)[2];
    }
  }
  EXPECT_GT(links, 50);
}

TEST(Docs, TheIndexNamesEveryDocument) {
  const std::string index = read_file(kDocs / "README.md");
  for (const auto& document : documents()) {
    const std::string name = document.filename();
    if (name == "README.md") continue;
    EXPECT_THAT(index, HasSubstr("](" + name + ")"));
  }
}

TEST(Docs, EveryOptionOfAShownCommandIsInItsHelp) {
  std::size_t commands = 0;
  for (const auto& document : documents()) {
    for (const std::string& line : lines_of(document)) {
      if (!line.starts_with("    ")) continue;
      for (const ShownCommand& command : commands_in(line)) {
        ++commands;
        std::set<std::string> known = options_in(help_of({command.program.front()}));
        known.merge(options_in(help_of(command.program)));
        for (const std::string& option : options_in(command.arguments)) {
          EXPECT_TRUE(known.contains(option)) << document << ": " << line;
        }
      }
    }
  }
  EXPECT_GT(commands, 40);
}

TEST(Docs, TheyListEveryOptionOfAnUpload) {
  const std::set<std::string> everywhere = options_in(help_of({ISOMESH}));
  const std::string uploads = read_file(kDocs / "uploads.md");
  for (const std::string& option : options_in(help_of({ISOMESH, "upload"}))) {
    if (everywhere.contains(option)) continue;
    EXPECT_THAT(uploads, HasSubstr("\n| `" + option));
  }
}

TEST(Docs, TheyListEveryFormatOfMeshes) {
  static const std::regex form(R"re("(\w+)")re");
  const std::string formats = names_of<MeshFormat>();
  std::set<std::string> names;
  for (std::sregex_iterator found(formats.begin(), formats.end(), form), end; found != end;
       ++found) {
    names.insert((*found)[1]);
  }
  ASSERT_TRUE(names.contains("glb")) << formats;
  for (const std::string file : {"formats.md", "labels.md"}) {
    const std::vector<std::string> lines = lines_of(kDocs / file);
    for (const std::string& name : names) {
      const bool is_only_for_labels = name == "zip";
      if (is_only_for_labels && file == "formats.md") continue;
      const auto names_it = [&](const std::string& line) {
        const std::string first = line.substr(0, line.find('|', 1));
        return line.starts_with("| `") && first.find('`' + name + '`') != std::string::npos;
      };
      EXPECT_TRUE(std::ranges::any_of(lines, names_it)) << "docs/" << file << " lacks " << name;
    }
  }
}

TEST(Docs, TheyTellHowSizesMayBeWritten) {
  EXPECT_THAT(read_file(kDocs / "operating.md"),
              HasSubstr("`8GiB`, `8GB` and `8G` all mean 8589934592"));
  for (const std::string size : {"8GiB", "8GB", "8G"}) {
    const Finished told = run({ISOMESHD, "check", "--max-upload", size});
    EXPECT_THAT(told.output, HasSubstr("max-upload = 8589934592\n")) << told.errors;
  }
}

}  // namespace
}  // namespace isomesh
