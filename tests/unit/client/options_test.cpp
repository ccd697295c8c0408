// The command line: accepted and rejected options.
#include "client/cli/options.h"

#include <cstdlib>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/exit_status.h"
#include "proto/json.h"
#include "proto/parameters.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using test::end_of;
using test::options_from;
using test::with;
using testing::ElementsAre;
using testing::HasSubstr;

using Words = std::vector<std::string>;

class OptionsTest : public testing::Test {
 protected:
  OptionsTest() { test::write_file(folder_ / "head.nii", "x"); }

  // The words of `isomesh mesh` with an iso-value and a file of that format.
  Words mesh(const Words& more, const std::string& suffix = ".glb") const {
    return with({"mesh", file_, "--iso", "1", "-o", folder_ / ("head" + suffix)}, more);
  }

  static void expect_refused(const Words& words, const std::string& told = {}) {
    const auto [status, text] = end_of(words);
    EXPECT_EQ(status, kWrongUsage) << testing::PrintToString(words);
    EXPECT_THAT(text, HasSubstr("isomesh: " + told));
  }

  const test::TemporaryFolder folder_;
  const std::string file_ = (folder_ / "head.nii").string();
  const std::string drc_ = (folder_ / "brain.drc").string();
};

TEST_F(OptionsTest, ReadsRawSamples) {
  const Options options = options_from(
      {"upload", file_, "--dims", "512,512,300", "--type", "int16", "--spacing", "0.7,0.7,1",
       "--origin", "-90,0,1.5", "--direction", "1,0,0,0,1,0,0,0,-1", "--byte-order", "big"});
  ASSERT_TRUE(options.upload.raw);
  EXPECT_THAT(options.upload.raw->dims, ElementsAre(512, 512, 300));
  EXPECT_EQ(options.upload.raw->type, SampleType::kInt16);
  ASSERT_TRUE(options.upload.spacing);
  EXPECT_THAT(*options.upload.spacing, ElementsAre(0.7, 0.7, 1));
  EXPECT_THAT(options.upload.raw->geometry.origin, ElementsAre(-90, 0, 1.5));
  EXPECT_EQ(options.upload.raw->geometry.direction.back(), -1);
  EXPECT_TRUE(options.upload.raw->big_endian);
}

TEST_F(OptionsTest, AnIsoValueMayBeAPreset) {
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "bone"}).parameters.preset, "bone");
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "Soft-Tissue"}).parameters.preset,
            "soft-tissue");
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "250"}).parameters.preset, "");
  EXPECT_EQ(end_of({"submit", "abc", "--iso", "bones"}).first, kWrongUsage);
}

TEST_F(OptionsTest, WordsAfterAnOutputAreInputs) {
  const Options options = options_from({"mesh", "--iso", "1", "-o", drc_, file_});
  EXPECT_THAT(options.files, ElementsAre(file_));
  EXPECT_EQ(options.outputs.size(), 1U);
}

TEST_F(OptionsTest, OutputsAreFilesFoldersNamesOrStandardOutput) {
  const std::vector<std::string> mesh = {"mesh", file_, "--iso", "1"};
  const auto outputs_of = [&](const std::vector<std::string>& more) {
    return options_from(with(mesh, more)).outputs;
  };
  const std::string folder = folder_.path().string();
  const std::string upper = folder + "/brain.DRC";
  const std::string named = folder + "/{name}-skin.ply";
  EXPECT_EQ(outputs_of({"-o", upper}), (std::vector<Output>{{upper, MeshFormat::kDrc}}));
  EXPECT_EQ(outputs_of({"-o", named}), (std::vector<Output>{{named, MeshFormat::kPly}}));
  EXPECT_EQ(outputs_of({"-o", folder}),
            (std::vector<Output>{{folder + "/{name}.drc", MeshFormat::kDrc}}));
  EXPECT_EQ(outputs_of({"-o", folder, "--format", "STL,glb"}),
            (std::vector<Output>{{folder + "/{name}.stl", MeshFormat::kStl},
                                 {folder + "/{name}.glb", MeshFormat::kGlb}}));
  EXPECT_EQ(outputs_of({"-o", "-", "--format", "stl"}),
            (std::vector<Output>{{"-", MeshFormat::kStl}}));

  EXPECT_EQ(outputs_of({"-o", folder + "/new/folder/"}),
            (std::vector<Output>{{folder + "/new/folder/{name}.drc", MeshFormat::kDrc}}));
  EXPECT_EQ(outputs_of({"-o", folder + "/new/{folder}/{name}.stl"}),
            (std::vector<Output>{{folder + "/new/{folder}/{name}.stl", MeshFormat::kStl}}));
  EXPECT_FALSE(std::filesystem::exists(folder + "/new")) << "it is made when a mesh is written";
  EXPECT_EQ(outputs_of({"-o", "/dev/stdout", "--format", "stl"}),
            (std::vector<Output>{{"-", MeshFormat::kStl}}));
  EXPECT_EQ(outputs_of({"-o", "/dev/null", "--format", "stl"}),
            (std::vector<Output>{{"/dev/null", MeshFormat::kStl}}));

  for (const Words& wrong : std::vector<Words>{{"-o", "-"},
                                               {"-o", "-", "--format", "stl,glb"},
                                               {"-o", "-", "--format", "stl", "--json"},
                                               {"-o", "-", "--format", "stl", "-o", drc_},
                                               {"-o", file_ + "/"},
                                               {"-o", folder + "/absent/{name}.stl"},
                                               {"-o", "/nowhere/brain.drc"},
                                               {"-o", "/dev/null"},
                                               {"-o", "brain.xyz"},
                                               {"-o", "brain"},
                                               {"-o", drc_, "--format", "drc"},
                                               {"-o", drc_, "-o", named},
                                               {"-o", folder, "--format", "xyz"},
                                               {}}) {
    expect_refused(with(mesh, wrong));
  }
  expect_refused({"mesh", "-", "-", "--iso", "1", "-o", folder});
}

TEST_F(OptionsTest, AListOfOutputsIsRejectedWithAHint) {
  const std::string list = (folder_ / "x.glb,y.stl").string();
  expect_refused({"mesh", file_, "--iso", "1", "-o", list},
                 "-o: " + list + " looks like a list; repeat the option instead: -o " +
                     (folder_ / "x.glb").string() + " -o y.stl");
  const std::string one = (folder_ / "a,b.stl").string();
  EXPECT_EQ(end_of({"mesh", file_, "--iso", "1", "-o", one}).first, -1);
}

TEST_F(OptionsTest, ADryRunNeedsNoOutput) {
  const Options options =
      options_from({"mesh", file_, "--iso", "1", "--dry-run", "--format", "stl,obj"});
  EXPECT_TRUE(options.dry_run);
  EXPECT_THAT(options.parameters.formats, ElementsAre(MeshFormat::kStl, MeshFormat::kObj));
  expect_refused({"mesh", file_, "--labels", "1", "--dry-run", "--label-values", "1=2"});
}

TEST_F(OptionsTest, LocalTakesWhatMeshTakesButNoServer) {
  const Options options = options_from({"local", file_, "--iso", "1", "-o", drc_, "-q"});
  EXPECT_EQ(options.command, Command::kMesh);
  EXPECT_TRUE(options.is_local);
  EXPECT_TRUE(options.quiet);
  EXPECT_FALSE(options_from({"mesh", file_, "--iso", "1", "-o", drc_}).is_local);
  for (const Words& words :
       std::vector<Words>{{"--server", "http://h:1", "local", file_, "--iso", "1", "-o", drc_},
                          {"local", file_, "--iso", "1", "-o", drc_, "--server=http://h:1"}}) {
    expect_refused(words, "--server does not apply to `isomesh local`");
  }
}

TEST_F(OptionsTest, AStoredVolumeStandsInPlaceOfAFile) {
  EXPECT_THAT(options_from({"mesh", "3f2a91c0", "--iso", "1", "-o", drc_}).files,
              ElementsAre("3f2a91c0"));
  expect_refused({"mesh", "3f2", "--iso", "1", "-o", drc_});
  expect_refused({"local", "3f2a91c0", "--iso", "1", "-o", drc_});
  expect_refused({"upload", "3f2a91c0"});
  expect_refused({"mesh", "3f2a91c0", "--name", "n", "--iso", "1", "-o", drc_},
                 "--name applies to files, not to stored volumes");
  expect_refused({"mesh", "3f2a91c0", file_, "--iso", "1", "-o", drc_},
                 "-o: several volumes need a folder");
}

TEST_F(OptionsTest, TakesGlobalOptionsBeforeAndAfterTheCommand) {
  for (const auto& options :
       {options_from({"--server", "unix:/s", "--token", "t", "--json", "status", "7"}),
        options_from({"status", "7", "--server", "unix:/s", "--token", "t", "--json"}),
        options_from({"status", "--json", "7", "--server=unix:/s", "--token=t"})}) {
    EXPECT_EQ(options.server, "unix:/s");
    EXPECT_EQ(options.token, "t");
    EXPECT_TRUE(options.json);
    EXPECT_EQ(options.id, "7");
  }
}

TEST_F(OptionsTest, TakesServerAndTokenFromTheEnvironment) {
  ::setenv("ISOMESH_SERVER", "http://elsewhere:1", 1);
  ::setenv("ISOMESH_TOKEN", "from-environment", 1);
  const Options fallback = options_from({"list"});
  const Options given = options_from({"list", "--server", "http://here:2"});
  ::unsetenv("ISOMESH_SERVER");
  ::unsetenv("ISOMESH_TOKEN");
  EXPECT_EQ(fallback.server, "http://elsewhere:1");
  EXPECT_EQ(fallback.token, "from-environment");
  EXPECT_EQ(given.server, "http://here:2");
  EXPECT_EQ(options_from({"list"}).server, "http://127.0.0.1:8080");
}

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

TEST_F(OptionsTest, MeshTakesEveryParameterOfTheTable) {
  JobParameters table;
  table.callback.emplace();
  int parameters = 0;
  visit_leaves(table, [&](const std::string& path, const Parameter& parameter, const auto& member) {
    if (path == "volume" || path == "formats") return;
    ++parameters;
    const bool is_by_labels = parameter.jobs == JobKind::kByLabels;
    Words words = {"mesh", file_, "-o", (folder_ / "head.glb").string()};
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

TEST_F(OptionsTest, MasksAreMeshedAsLabels) {
  const Options all = options_from({"mesh", file_, "--masks", "-o", folder_ / "all.glb"});
  EXPECT_TRUE(all.upload.masks);
  ASSERT_TRUE(all.parameters.labels);
  EXPECT_TRUE(all.parameters.labels->is_all());
  EXPECT_EQ(all.parameters.smoothing, label_parameters({}).smoothing);
  const Options one =
      options_from({"mesh", file_, "--masks", "--labels", "2", "-o", folder_ / "one.stl"});
  EXPECT_THAT(one.parameters.labels->values, ElementsAre(2));
  EXPECT_FALSE(options_from(mesh({})).upload.masks);
}

TEST_F(OptionsTest, RefusesWrongUsageAndNamesTheOptionAndItsRange) {
  const std::vector<std::pair<Words, std::string>> refusals = {
      {{}, ""},
      {{"frobnicate"}, "there is no command frobnicate\n"},
      {{"mehs", file_}, "there is no command mehs. Did you mean mesh?\n"},
      {mesh({"--pases", "3"}), "there is no option --pases. Did you mean --passes?\n"},
      {mesh({"--serve", "x"}), "there is no option --serve. Did you mean --server?"},
      {mesh({"--zzzzzz"}), "there is no option --zzzzzz\n"},
      {{"status"}, ""},
      {{"status", "7", "8"}, ""},
      {{"list", "--state", "melted"}, "--state: must be "},
      {{"completion", "cmd"}, "SHELL must be bash, zsh or fish"},
      {{"mesh", file_, "--masks", "--iso", "1", "-o", drc_}, "--iso cannot be used with --masks"},
      {{"mesh", file_, "-o", drc_}, "--iso or --labels is required"},
      {{"mesh", file_, "--iso", "60"}, "-o is required"},
      {{"mesh", "/nowhere/head.nii", "--iso", "60", "-o", drc_},
       "FILE: /nowhere/head.nii does not"},
      {{"submit", "abc", "--iso", "60", "--format", "drc,xyz"}, "--format: must be "},
      {{"submit", "abc", "--passes", "1", "--passes", "2"}, "--passes can only be given once"},
      {mesh({"--passes", "1.5"}), "--passes: must be a whole number from 0 to 1000\n"},
      {mesh({"--passes", "1001"}), "--passes: must be a whole number from 0 to 1000\n"},
      {mesh({"--passes", "99999999999"}), "--passes: must be a whole number from 0 to 1000\n"},
      {mesh({"--lambda", "2"}), "--lambda: must be a number above 0 and at most 1"},
      {mesh({"--scheme", "7"}), R"(--scheme: must be 5, 6, "fcc", "kuhn" or "bcc")"},
      {mesh({"--smoothing", "gauss"}), "--smoothing: must be "},
      {mesh({"--position-bits", "7"}), "--position-bits: must be a whole number from 8 to 30"},
      {mesh({"--max-error", "0"}), "--max-error: must be a number from 0.001 to 1000"},
      {mesh({"--crop", "1,1,1,0,0,0"}), "--crop: must have a first corner that is smaller"},
      {mesh({"--lods", "1,0.5"}, ".stl"), "--lods: needs the format \"glb\"\n"},
      {mesh({"--jobs", "x"}), "--jobs: must be a whole number from 1 to 64"},
      {mesh({"--jobs", "0"}), "--jobs: must be a whole number from 1 to 64"},
      {mesh({"--jobs", "65"}), "--jobs: must be a whole number from 1 to 64"},
      {mesh({"--volume", "-1"}), "--volume: must be a whole number from 0 to 4294967295"},
      {{"upload", file_, "--dims", "1,2,3"}, "--dims requires --type"},
      {{"upload", file_, "--type", "int16"}, "--type requires --dims"},
      {{"upload", file_, "--origin", "1,1,1"}, "--origin requires --dims"},
      {{"upload", file_, "--spacing", "0,1,1"}, "--spacing: must be three numbers above 0"},
      {{"submit", "abc", "--labels", "1", "--label-color", "1=red"}, "--label-color: must be a"},
      {{"submit", "abc", "--labels", "1", "--label-name", "Liver"}, "--label-name: \"Liver\" must"},
      {{"submit", "abc", "--labels", "1", "--min-triangles", "5"}, ""},
      {{"submit", "abc", "--labels", "1", "--interpolation", "linear"}, ""},
      {{"submit", "abc", "--labels", "1", "--iso", "3"}, ""},
      {{"submit", "abc", "--iso", "3", "--background", "1"}, "--background requires --labels"},
      {{"mesh", file_, "--labels", "all", "-o", drc_}, "-o: " + drc_ + " can hold only one label"}};
  for (const auto& [words, told] : refusals) expect_refused(words, told);
  for (const std::string iso : {"sixty", "nan", "60x", "", "bones"}) {
    expect_refused({"submit", "abc", "--iso", iso}, "--iso: must be a finite number, ");
  }
  for (const std::string dims : {"1,2", "1,2,3,4", "1,,3", "1,2,3,", "99999999999,2,2", "0,2,2"}) {
    expect_refused({"upload", file_, "--dims", dims, "--type", "int16"},
                   "--dims: must be three whole numbers from 1 to 4294967295");
  }
  const Words raw = {"upload", file_, "--dims", "1,2,3", "--type"};
  expect_refused(with(raw, {"int12"}), "--type: must be ");
  expect_refused(with(raw, {"int16", "--byte-order", "middle"}), "--byte-order: must be little");
  for (const std::string labels : {"5-1", "1-", "1-2-3", "-", "", "1,,2", "1-4294967295",
                                   "0-9223372036854775807", "9223372036854775808", "a-b", "one"}) {
    expect_refused({"submit", "abc", "--labels", labels}, "--labels: must be ");
  }
}

TEST_F(OptionsTest, LabelsMayBeRanges) {
  const auto labels_of = [&](const std::string& text) {
    return options_from({"submit", "abc", "--labels", text}).parameters.labels->values;
  };
  EXPECT_THAT(labels_of("1-5"), ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(labels_of("1,3-5"), ElementsAre(1, 3, 4, 5));
  EXPECT_THAT(labels_of("-3--1,7"), ElementsAre(-3, -2, -1, 7));
  EXPECT_THAT(labels_of("4294967295"), ElementsAre(4294967295));
  EXPECT_THAT(labels_of("9223372036854775806-9223372036854775807"),
              ElementsAre(9223372036854775806, 9223372036854775807));
}

TEST_F(OptionsTest, TextsAreUtf8) {
  EXPECT_EQ(options_from({"rename", "abc", "Gr\u00f6\u00dfe \"1\""}).name, "Gr\u00f6\u00dfe \"1\"");
  expect_refused({"rename", "abc", "\xff"}, "NAME: is not UTF-8");
  expect_refused({"upload", file_, "--name", "Gr\xf6"}, "--name: is not UTF-8");
  const std::string latin = (folder_ / "gr\xf6.nii").string();
  test::write_file(latin, "x");
  EXPECT_EQ(options_from({"upload", latin}).files.front(), latin);
}

TEST_F(OptionsTest, AGlbThatIsSavedHasNoCodecUnlessOneIsNamed) {
  const auto codec_of = [](const Words& words) { return options_from(words).parameters.glb_codec; };
  EXPECT_EQ(codec_of(mesh({})), GlbCodec::kNone);
  EXPECT_EQ(codec_of(mesh({"-o", folder_ / "head.stl"})), GlbCodec::kNone);
  EXPECT_EQ(codec_of({"local", file_, "--iso", "1", "-o", folder_ / "head.glb"}), GlbCodec::kNone);
  EXPECT_EQ(
      codec_of({"mesh", file_, "--iso", "1", "-o", folder_.path().string(), "--format", "stl,glb"}),
      GlbCodec::kNone);
  EXPECT_EQ(codec_of({"mesh", file_, "--iso", "1", "--dry-run", "--format", "glb"}),
            GlbCodec::kNone);
  for (const GlbCodec codec : values_of<GlbCodec>()) {
    EXPECT_EQ(codec_of(mesh({"--glb-codec", std::string(to_string(codec))})), codec);
  }
}

TEST_F(OptionsTest, DracosOptionsAskForDracoUnlessADrcFileTakesThem) {
  const std::string drc = folder_ / "head.drc";
  for (const Words& words : {Words{"--position-bits", "16"}, Words{"--speed", "2"}}) {
    EXPECT_EQ(options_from(mesh(words)).parameters.glb_codec, GlbCodec::kDraco);
    Words both = words;
    both.insert(both.end(), {"-o", drc});
    EXPECT_EQ(options_from(mesh(both)).parameters.glb_codec, GlbCodec::kNone);
    Words named = words;
    named.insert(named.end(), {"--glb-codec", "quantized"});
    EXPECT_EQ(options_from(mesh(named)).parameters.glb_codec, GlbCodec::kQuantized);
  }
}

// Jobs without a GLB can share their meshes with those of other clients; those of `submit` are for
// any of them.
TEST_F(OptionsTest, OtherJobsHaveTheCodecOfTheApi) {
  for (const std::string command : {"submit", "estimate"}) {
    EXPECT_EQ(options_from({command, "abc", "--iso", "1", "--format", "glb"}).parameters.glb_codec,
              MeshParameters{}.glb_codec);
  }
  EXPECT_EQ(options_from(mesh({}, ".stl")).parameters.glb_codec, MeshParameters{}.glb_codec);
  EXPECT_EQ(options_from(mesh({"--glb-codec", "meshopt"}, ".stl")).parameters.glb_codec,
            GlbCodec::kMeshopt);
}

TEST_F(OptionsTest, HelpTellsTheCodecOfASavedGlb) {
  for (const std::string command : {"mesh", "local"}) {
    const auto [status, text] = end_of({command, "--help"});
    EXPECT_EQ(status, 0);
    EXPECT_THAT(text, HasSubstr("quantized; default: none)")) << command;
  }
  EXPECT_THAT(end_of({"submit", "--help"}).second, HasSubstr("quantized; default: draco)"));
}

TEST_F(OptionsTest, ReadsWhatLabelsCanBeAskedFor) {
  const std::string glb = (folder_ / "body.glb").string();
  const Options options =
      options_from({"mesh", file_, "--labels", "1,5", "--background", "9", "--label-name",
                    "1=Left lung", "--label-name", "5=Heart", "--label-color", "5=#ff0000",
                    "--label-values", "5=5,6", "-o", glb});
  const JobParameters& parameters = options.parameters;
  EXPECT_EQ(parameters.labels, (LabelChoice{{1, 5}}));
  EXPECT_EQ(parameters.background, 9);
  EXPECT_EQ(parameters.passes, label_parameters({}).passes);
  EXPECT_EQ(parameters.smoothing, Smoothing::kLabels);
  EXPECT_TRUE(parameters.regularize);
  EXPECT_FALSE(options_from({"mesh", file_, "--labels", "all", "--no-regularize", "-o", glb})
                   .parameters.regularize);
  EXPECT_EQ(parameters.label_names, (LabelTexts{{1, "Left lung"}, {5, "Heart"}}));
  EXPECT_EQ(parameters.label_colors, (LabelTexts{{5, "#ff0000"}}));
  EXPECT_EQ(parameters.label_values, (LabelValues{{5, {5, 6}}}));
  EXPECT_EQ(options_from({"mesh", file_, "--labels", "all", "--passes", "5", "-o", glb})
                .parameters.passes,
            5);
}

}  // namespace
}  // namespace isomesh::cli
