// The command line: accepted and rejected options, and the help texts.
#include <map>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/command_line/closest.h"
#include "base/command_line/help.h"
#include "client/cli/ids.h"
#include "client/cli/options.h"
#include "proto/json.h"
#include "proto/parameters.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using test::end_of;
using test::options_from;
using test::with;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

class CommandLine : public testing::Test {
 protected:
  CommandLine() { test::write_file(folder_ / "head.nii", "x"); }

  // The words of `isomesh mesh` with an iso-value and a file of that format.
  std::vector<std::string> mesh(const std::vector<std::string>& more,
                                const std::string& suffix = ".glb") {
    return with({"mesh", file_, "--iso", "1", "-o", folder_ / ("head" + suffix)}, more);
  }

  test::TemporaryFolder folder_;
  std::string file_ = (folder_ / "head.nii").string();
};

// A value of the parameter's option that is not its default.
template <class Member>
std::vector<std::string> some_value(const Parameter& parameter, const Member& standard) {
  const std::string option = "--" + option_name_of(parameter);
  const std::map<std::string, std::string> values = {{"iso", "7"},
                                                     {"labels", "1,3-5"},
                                                     {"label-name", "1=Liver"},
                                                     {"lods", "1,0.5"},
                                                     {"crop", "0,0,0,1,2,3"},
                                                     {"label-color", "1=#ff0000"},
                                                     {"scheme", "5"},
                                                     {"keep-nearest-to", "1,2,3"},
                                                     {"label-values", "1=2-4"},
                                                     {"smoothing", "taubin"},
                                                     {"max-displacement", "0.5"},
                                                     {"callback", "https://ris.example/done"}};
  if (const auto found = values.find(option.substr(2)); found != values.end()) {
    return {option, found->second};
  }
  if constexpr (std::is_same_v<Member, bool>) {
    return {standard ? "--no-" + option.substr(2) : option};
  } else if constexpr (Enumeration<Member> && !std::is_same_v<Member, Scheme>) {
    return {option, std::string(to_string(values_of<Member>().back()))};
  } else {
    EXPECT_TRUE(parameter.maximum) << option << " has no value here";
    return {option, number_text(parameter.maximum.value_or(0))};
  }
}

TEST_F(CommandLine, MeshTakesEveryParameterOfTheTable) {
  JobParameters table;
  table.callback.emplace();
  int parameters = 0;
  visit_leaves(table, [&](const std::string& path, const Parameter& parameter, const auto& member) {
    if (path == "volume" || path == "formats") return;
    ++parameters;
    const bool is_by_labels = parameter.jobs == JobKind::kByLabels;
    std::vector<std::string> words = {"mesh", file_, "-o", (folder_ / "head.glb").string()};
    if (path != "labels" && is_by_labels) words.insert(words.end(), {"--labels", "all"});
    if (path != "iso" && !is_by_labels) words.insert(words.end(), {"--iso", "1"});
    const JobParameters without =
        path == "labels" || path == "iso" ? JobParameters{} : options_from(words).parameters;
    words = with(words, some_value(parameter, member));
    const auto [status, text] = end_of(words);
    EXPECT_EQ(status, -1) << path << ": " << text;
    if (status != -1) return;
    EXPECT_NE(to_json(options_from(words).parameters), to_json(without)) << path;
  });
  EXPECT_GE(parameters, 30);
}

TEST_F(CommandLine, RejectionsNameTheOptionAndItsRange) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"--passes", "2.5"}, "--passes: must be a whole number from 0 to 1000\n"},
      {{"--passes", "1001"}, "--passes: must be a whole number from 0 to 1000\n"},
      {{"--lambda", "2"}, "--lambda: must be a number above 0 and at most 1"},
      {{"--scheme", "7"}, R"(--scheme: must be 5, 6, "fcc", "kuhn" or "bcc")"},
      {{"--position-bits", "7"}, "--position-bits: must be a whole number from 8 to 30"},
      {{"--max-error", "0"}, "--max-error: must be a number from 0.001 to 1000"},
      {{"--crop", "1,1,1,0,0,0"}, "--crop: must have a first corner that is smaller"},
      {{"--jobs", "x"}, "--jobs: must be a whole number from 1 to 64"},
      {{"--volume", "-1"}, "--volume: must be a whole number from 0 to 4294967295"},
      {{"--dims", "99999999999,2,2", "--type", "int8"},
       "--dims: must be three whole numbers from 1 to 4294967295"},
      {{"--dims", "0,2,2", "--type", "int8"}, "--dims: must be three whole numbers from 1"}};
  for (const auto& [words, told] : wrong) {
    const auto [status, text] = end_of(mesh(words));
    EXPECT_EQ(status, kWrongUsage) << told;
    EXPECT_THAT(text, HasSubstr("isomesh: " + told));
  }
  const auto [status, text] = end_of(mesh({"--lods", "1,0.5"}, ".stl"));
  EXPECT_EQ(status, kWrongUsage);
  EXPECT_EQ(text, "isomesh: --lods: needs the format \"glb\"\n");
  EXPECT_THAT(end_of({"submit", "abc", "--labels", "1", "--label-color", "1=red"}).second,
              HasSubstr("--label-color: must be a colour"));
  EXPECT_THAT(end_of({"submit", "abc", "--labels", "1", "--min-triangles", "5"}).second,
              HasSubstr("--min-triangles"));
}

TEST_F(CommandLine, LabelsMayBeRanges) {
  const auto labels_of = [&](const std::string& text) {
    return options_from({"submit", "abc", "--labels", text}).parameters.labels->values;
  };
  EXPECT_THAT(labels_of("1-5"), ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(labels_of("1,3-5"), ElementsAre(1, 3, 4, 5));
  EXPECT_THAT(labels_of("-3--1,7"), ElementsAre(-3, -2, -1, 7));
  EXPECT_THAT(labels_of("4294967295"), ElementsAre(4294967295));
  for (const std::string wrong : {"5-1", "1-", "1-2-3", "-", "", "1,,2", "1-4294967295",
                                  "4294967296", "9223372036854775807", "a-b"}) {
    const auto [status, text] = end_of({"submit", "abc", "--labels", wrong});
    EXPECT_EQ(status, kWrongUsage) << wrong;
    EXPECT_THAT(text, HasSubstr("--labels: must be ")) << wrong;
  }
}

TEST_F(CommandLine, SuggestsWhatWasMeant) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"mehs", file_}, "there is no command mehs. Did you mean mesh?\n"},
      {mesh({"--pases", "3"}), "there is no option --pases. Did you mean --passes?\n"},
      {mesh({"--serve", "x"}), "Did you mean --server?"},
      {{"frobnicate"}, "there is no command frobnicate\n"},
      {mesh({"--zzzzzz"}), "there is no option --zzzzzz\n"}};
  for (const auto& [words, told] : wrong) {
    const auto [status, text] = end_of(words);
    EXPECT_EQ(status, kWrongUsage);
    EXPECT_THAT(text, HasSubstr(told));
  }
  EXPECT_EQ(command_line::closest_to("lst", {"list", "labels"}), "list");
  EXPECT_EQ(command_line::closest_to("x", {"y"}), "");
}

TEST_F(CommandLine, AListOfOutputsIsRejectedWithAHint) {
  const auto [status, text] =
      end_of({"mesh", file_, "--iso", "1", "-o", (folder_ / "x.glb,y.stl").string()});
  EXPECT_EQ(status, kWrongUsage);
  EXPECT_THAT(text, HasSubstr("repeat the option instead: -o "));
  EXPECT_THAT(text, HasSubstr("x.glb -o y.stl"));
  const std::string one = (folder_ / "a,b.stl").string();
  EXPECT_EQ(end_of({"mesh", file_, "--iso", "1", "-o", one}).first, -1);
}

TEST_F(CommandLine, LocalTakesNoServer) {
  const std::string output = (folder_ / "x.stl").string();
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"--server", "http://h:1", "local", file_, "--iso", "1", "-o", output},
           {"local", file_, "--iso", "1", "-o", output, "--server=http://h:1"}}) {
    const auto [status, text] = end_of(words);
    EXPECT_EQ(status, kWrongUsage);
    EXPECT_THAT(text, HasSubstr("--server does not apply to `isomesh local`"));
  }
}

TEST_F(CommandLine, AStoredVolumeStandsInPlaceOfAFile) {
  const std::string output = (folder_ / "x.stl").string();
  EXPECT_THAT(options_from({"mesh", "3f2a91c0", "--iso", "1", "-o", output}).files,
              ElementsAre("3f2a91c0"));
  EXPECT_EQ(end_of({"mesh", "3f2", "--iso", "1", "-o", output}).first, kWrongUsage);
  EXPECT_EQ(end_of({"local", "3f2a91c0", "--iso", "1", "-o", output}).first, kWrongUsage);
  EXPECT_EQ(end_of({"upload", "3f2a91c0"}).first, kWrongUsage);
  EXPECT_THAT(end_of({"mesh", "3f2a91c0", "--name", "n", "--iso", "1", "-o", output}).second,
              HasSubstr("--name applies to files, not to stored volumes"));
  EXPECT_THAT(end_of({"mesh", "3f2a91c0", file_, "--iso", "1", "-o", output}).second,
              HasSubstr("several volumes need a folder"));
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
  const std::string manual = end_of({"manual"}).second;
  for (const std::string& command : commands) {
    const std::string help = end_of({command, "--help"}).second;
    EXPECT_THAT(help, HasSubstr("\nExamples:\n  isomesh ")) << command;
    for (const std::string& line : lines_of(help + overview)) EXPECT_LE(line.size(), 80U) << line;
    EXPECT_THAT(manual, HasSubstr("\n  isomesh " + command)) << command;
  }
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

TEST(Completion, OffersIdsAndTheWordsOfLists) {
  const std::string bash = end_of({"completion", "bash"}).second;
  EXPECT_THAT(bash, HasSubstr("isomesh ids volumes"));
  EXPECT_THAT(bash, HasSubstr("isomesh ids jobs"));
  EXPECT_THAT(bash, HasSubstr("drc glb"));
  EXPECT_THAT(bash, HasSubstr("'bash zsh fish'"));
  EXPECT_THAT(end_of({"completion", "zsh"}).second, HasSubstr("isomesh ids volumes"));
  EXPECT_THAT(end_of({"completion", "fish"}).second, HasSubstr("isomesh ids volumes"));
}

}  // namespace
}  // namespace isomesh::cli
