// How the command describes itself: help, manual page, version and completions.
#include "base/command_line/help.h"

#include <array>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/command_line/closest.h"
#include "client/cli/exit_status.h"
#include "client/cli/ids.h"
#include "client/cli/options.h"
#include "proto/parameters.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using test::end_of;
using test::options_from;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(Ids, MayBeShortenedWhereTheyAreUnique) {
  const std::vector<Candidate> all = {{"0192-aaaa-11", "one"}, {"0192-bbbb-22", "two"}};
  EXPECT_EQ(whole_id("0192-a", "job", all), "0192-aaaa-11");
  EXPECT_EQ(whole_id("b-22", "job", all), "0192-bbbb-22");
  EXPECT_EQ(whole_id("0192-aaaa-11", "job", all), "0192-aaaa-11");
  const Error none = test::error_of([&] { whole_id("ffff", "job", all); });
  EXPECT_EQ(none.code(), ErrorCode::kNotFound);
  EXPECT_STREQ(none.what(), "there is no job whose id begins or ends with ffff");
  EXPECT_STREQ(test::error_of([&] { whole_id("0192", "job", all); }).what(),
               "the id 0192 is ambiguous: 2 jobs have it\n"
               "  0192-aaaa-11  one\n"
               "  0192-bbbb-22  two");
}

TEST(Help, FitsATerminalAndShowsExamples) {
  const std::string overview = end_of({"--help"}).second;
  std::vector<std::string> commands;
  bool is_command = false;
  for (const std::string& line : lines_of(overview)) {
    if (line == "Subcommands:") is_command = true;
    if (line.empty()) is_command = false;
    if (is_command && line.starts_with("  ") && line[2] != ' ') {
      commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  EXPECT_THAT(commands, Contains("mesh"));
  EXPECT_GE(commands.size(), 17U);
  EXPECT_THAT(overview, HasSubstr("Exit status: 0 done, 1 the job failed"));
  const auto [status, manual] = end_of({"manual"});
  EXPECT_EQ(status, 0);
  EXPECT_THAT(manual, HasSubstr(".SH NAME\nisomesh \\- "));
  EXPECT_THAT(manual, HasSubstr("\\fB\\-\\-max\\-displacement\\fR"));
  for (const std::string& command : commands) {
    const std::string help = end_of({command, "--help"}).second;
    EXPECT_THAT(help, HasSubstr("\nExamples:\n  isomesh ")) << command;
    for (const std::string& line : lines_of(help + overview)) EXPECT_LE(line.size(), 80U) << line;
    EXPECT_THAT(manual, HasSubstr("\n  isomesh " + command)) << command;
  }
}

// A query carries no names of labels and no callback.
TEST(Help, HasEveryParameterAndForAnEstimateThoseOfAQuery) {
  const std::string submit = end_of({"submit", "--help"}).second;
  const std::string estimate = end_of({"estimate", "--help"}).second;
  JobParameters parameters;
  parameters.callback.emplace();
  visit_leaves(parameters, [&](const std::string& path, const Parameter& parameter, const auto&) {
    if (path == "volume") return;
    const std::string option = "  --" + option_name_of(parameter) + ' ';
    EXPECT_THAT(submit, HasSubstr(option));
    EXPECT_EQ(estimate.find(option) != std::string::npos, parameter.in_query) << option;
  });
  std::string words;  // without line breaks
  std::istringstream stream(submit);
  for (std::string word; stream >> word;) words += (words.empty() ? "" : " ") + word;
  for (const std::string text :
       {"Number of tetrahedra per cell, or lattice (5, 6, fcc, kuhn or bcc; default: 6)",
        "(laplacian, ", "default: laplacian, labels with --labels)",
        "keeps the topology (default) --no-regularize Switch off --regularize",
        "(from 0 to 1000; default: 5, 10 with --labels)",
        "default: 1 for laplacian, 0.33 for taubin, ", "default: 0.1)", "position, in mm",
        "(default: drc)"}) {
    EXPECT_THAT(words, HasSubstr(text));
  }
  EXPECT_THAT(end_of({"mesh", "--help"}).second, Not(HasSubstr("The file formats to write")));
}

TEST(Help, BreaksLinesBetweenWords) {
  using command_line::wrapped;
  EXPECT_EQ(wrapped("one two", 4), "one two");
  const std::string word(39, 'x');
  EXPECT_EQ(wrapped(word + ' ' + word + ' ' + word, 2), word + ' ' + word + "\n  " + word);
  EXPECT_EQ(wrapped(word + ' ' + word, 2, 2), word + "\n  " + word);
  EXPECT_EQ(wrapped("one\ntwo", 2), "one\n  two");
}

TEST(Version, HasAShortOption) {
  EXPECT_EQ(end_of({"-V"}), end_of({"--version"}));
  EXPECT_EQ(end_of({"-V"}).first, 0);
  EXPECT_THAT(end_of({"-V"}).second, HasSubstr("isomesh "));
}

TEST(Completion, OffersCommandsOptionsValuesIdsAndFiles) {
  const auto offered = [](std::vector<std::string> words) {
    words.insert(words.begin(), "complete");
    return '\n' + end_of(words).second;
  };
  EXPECT_THAT(offered({""}), HasSubstr("\nmesh\tUpload volumes"));
  EXPECT_THAT(offered({""}), Not(HasSubstr("\nmanual")));
  EXPECT_THAT(offered({"mesh", "-"}), HasSubstr("\n--max-displacement\tSmoothing moves"));
  EXPECT_THAT(offered({"mesh", "-"}), HasSubstr("\n--server\t"));
  EXPECT_THAT(offered({"mesh", "--quiet", "--smoothing", "t"}), HasSubstr("\ntaubin\t\n"));
  EXPECT_THAT(offered({"submit", "abc", "--format", "drc,g"}), HasSubstr("\ndrc,glb\t\n"));
  EXPECT_THAT(offered({"completion", ""}), HasSubstr("\nbash\t\nzsh\t\nfish\t\n"));
  EXPECT_EQ(offered({"mesh", "--key", ""}), "\n:files\n");
  EXPECT_EQ(offered({"mesh", "-o", ""}), "\n:files\n");
  EXPECT_EQ(offered({"mesh", "--iso", "1", "--passes", ""}), "\n");
  const Options ids = options_from({"complete", "--server", "x", "info", ""});
  EXPECT_EQ(ids.command, Command::kIds);
  EXPECT_EQ(ids.kind, "volumes");
  for (const char* shell : {"bash", "zsh", "fish"}) {
    EXPECT_THAT(end_of({"completion", shell}).second, HasSubstr("complete")) << shell;
  }
}

TEST(Closest, IsANameWithFewOtherLetters) {
  EXPECT_EQ(command_line::closest_to("lst", {"list", "labels"}), "list");
  EXPECT_EQ(command_line::closest_to("x", {"y"}), "");
}

}  // namespace
}  // namespace isomesh::cli
