#include "client/cli/options.h"

#include <cstdlib>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/parameters.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using test::end_of;
using test::options_from;
using test::with;
using testing::ElementsAre;
using testing::HasSubstr;

class OptionsTest : public testing::Test {
 protected:
  OptionsTest() { test::write_file(folder_ / "head.nii", "x"); }

  test::TemporaryFolder folder_;
  std::string file_ = (folder_ / "head.nii").string();
  std::string drc_ = (folder_ / "brain.drc").string();
  std::string stl_ = (folder_ / "brain.stl").string();
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
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "bone"}).preset, "bone");
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "Soft-Tissue"}).preset, "soft tissue");
  EXPECT_EQ(options_from({"submit", "abc", "--iso", "250"}).preset, "");
  EXPECT_EQ(end_of({"submit", "abc", "--iso", "bones"}).first, kWrongUsage);
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

  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{"-o", "-"},
                                             {"-o", "-", "--format", "stl,glb"},
                                             {"-o", "-", "--format", "stl", "--json"},
                                             {"-o", "-", "--format", "stl", "-o", drc_},
                                             {"-o", file_ + "/"},
                                             {"-o", folder + "/absent/{name}.stl"},
                                             {"-o", "/dev/null"},
                                             {"-o", drc_, "--format", "drc"},
                                             {"-o", drc_, "-o", named},
                                             {"-o", folder, "--format", "xyz"},
                                             {"-o", drc_, "--jobs", "0"},
                                             {"-o", drc_, "--jobs", "65"},
                                             {}}) {
    EXPECT_EQ(end_of(with(mesh, wrong)).first, kWrongUsage) << testing::PrintToString(wrong);
  }
  EXPECT_EQ(end_of({"mesh", "-", "-", "--iso", "1", "-o", folder}).first, kWrongUsage);
}

TEST_F(OptionsTest, ADryRunNeedsNoOutput) {
  const Options options =
      options_from({"mesh", file_, "--iso", "1", "--dry-run", "--format", "stl,obj"});
  EXPECT_TRUE(options.dry_run);
  EXPECT_THAT(options.parameters.formats, ElementsAre(MeshFormat::kStl, MeshFormat::kObj));
  EXPECT_EQ(end_of({"mesh", file_, "--labels", "1", "--dry-run", "--label-values", "1=2"}).first,
            kWrongUsage);
}

// A query carries no names of labels and no callback.
TEST_F(OptionsTest, AnEstimateHasTheOptionsThatAQueryCarries) {
  const std::string help = end_of({"estimate", "--help"}).second;
  JobParameters parameters;
  parameters.callback.emplace();
  visit_leaves(parameters, [&](const std::string& path, const Parameter& parameter, const auto&) {
    if (path == "volume") return;
    const std::string option = "  --" + option_name_of(parameter) + ' ';
    const bool is_there = (help + ' ').find(option) != std::string::npos;
    EXPECT_EQ(is_there, parameter.in_query) << option;
  });
}

TEST_F(OptionsTest, LocalTakesWhatMeshTakes) {
  const Options options = options_from({"local", file_, "--iso", "1", "-o", drc_, "-q"});
  EXPECT_EQ(options.command, Command::kMesh);
  EXPECT_TRUE(options.is_local);
  EXPECT_TRUE(options.quiet);
  EXPECT_FALSE(options_from({"mesh", file_, "--iso", "1", "-o", drc_}).is_local);
}

TEST_F(OptionsTest, DescribesItselfToShellsAndReaders) {
  const auto [status, manual] = end_of({"manual"});
  EXPECT_EQ(status, 0);
  EXPECT_THAT(manual, HasSubstr(".SH NAME\nisomesh \\- "));
  EXPECT_THAT(manual, HasSubstr("\\fB\\-\\-max\\-displacement\\fR"));
  for (const char* shell : {"bash", "zsh", "fish"}) {
    EXPECT_THAT(end_of({"completion", shell}).second, HasSubstr("max-displacement")) << shell;
  }
  EXPECT_EQ(end_of({"completion", "cmd"}).first, kWrongUsage);
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

TEST_F(OptionsTest, RefusesWrongUsage) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"frobnicate"},
      {"status"},
      {"status", "7", "8"},
      {"mesh", file_, "-o", drc_},
      {"mesh", file_, "--iso", "60"},
      {"mesh", file_, "--iso", "sixty", "-o", drc_},
      {"mesh", file_, "--iso", "nan", "-o", drc_},
      {"mesh", file_, "--iso", "60x", "-o", drc_},
      {"mesh", file_, "--iso", "", "-o", drc_},
      {"mesh", file_, "--iso", "60", "--passes", "1.5", "-o", drc_},
      {"mesh", file_, "--iso", "60", "--passes", "99999999999", "-o", drc_},
      {"mesh", file_, "--iso", "60", "--smoothing", "gauss", "-o", drc_},
      {"mesh", file_, "--iso", "60", "-o", "brain.xyz"},
      {"mesh", file_, "--iso", "60", "-o", "brain"},
      {"mesh", file_, "--iso", "60", "-o", "/nowhere/brain.drc"},
      {"mesh", "/nowhere/head.nii", "--iso", "60", "-o", drc_},
      {"upload", file_, "--dims", "1,2,3"},
      {"upload", file_, "--type", "int16"},
      {"upload", file_, "--origin", "1,1,1"},
      {"upload", file_, "--spacing", "0,1,1"},
      {"upload", file_, "--dims", "1,2", "--type", "int16"},
      {"upload", file_, "--dims", "1,2,3,4", "--type", "int16"},
      {"upload", file_, "--dims", "1,,3", "--type", "int16"},
      {"upload", file_, "--dims", "1,2,3,", "--type", "int16"},
      {"upload", file_, "--dims", "1,2,3", "--type", "int12"},
      {"upload", file_, "--dims", "1,2,3", "--type", "int16", "--byte-order", "middle"},
      {"submit", "abc"},
      {"submit", "abc", "--iso", "60", "--format", "drc,xyz"},
      {"list", "--state", "melted"}};
  for (const auto& arguments : wrong) {
    const auto [status, text] = end_of(arguments);
    EXPECT_EQ(status, kWrongUsage) << (arguments.empty() ? "" : arguments.back());
    EXPECT_FALSE(text.empty());
  }
}

TEST_F(OptionsTest, SaysThatAnOptionWasGivenTwice) {
  const auto [status, text] = end_of({"submit", "abc", "--passes", "1", "--passes", "2"});
  EXPECT_EQ(status, kWrongUsage);
  EXPECT_THAT(text, HasSubstr("--passes can only be given once"));
}

TEST_F(OptionsTest, TextsAreUtf8) {
  EXPECT_EQ(options_from({"rename", "abc", "Gr\u00f6\u00dfe \"1\""}).name, "Gr\u00f6\u00dfe \"1\"");
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"rename", "abc", "\xff"},
        std::vector<std::string>{"upload", file_, "--name",
                                 "Gr\xf6\xdf"
                                 "e"}}) {
    const auto [status, text] = end_of(arguments);
    EXPECT_EQ(status, kWrongUsage) << arguments.front();
    EXPECT_THAT(text, HasSubstr(arguments.front() == "rename" ? "NAME: is not UTF-8"
                                                              : "--name: is not UTF-8"));
  }
  const std::string latin = (folder_ / "gr\xf6.nii").string();
  test::write_file(latin, "x");
  EXPECT_EQ(options_from({"upload", latin}).files.front(), latin);
}

TEST_F(OptionsTest, EveryParameterHasAnOptionAndItsHelp) {
  const std::string help = end_of({"submit", "--help"}).second;
  JobParameters parameters;
  visit_leaves(parameters, [&](const std::string& path, const Parameter& parameter, const auto&) {
    if (path == "volume") return;
    EXPECT_THAT(help, HasSubstr("--" + option_name_of(parameter) + ' '));
  });
  std::string words;  // without line breaks
  std::istringstream stream(help);
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
  EXPECT_THAT(end_of({"mesh", "--help"}).second,
              testing::Not(HasSubstr("The file formats to write")));
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

TEST_F(OptionsTest, RefusesWhatIsForLabelsWithoutThem) {
  const auto status_with = [&](const std::vector<std::string>& more) {
    return end_of(with({"mesh", file_, "-o", drc_}, more)).first;
  };
  EXPECT_EQ(status_with({"--iso", "3"}), -1);
  EXPECT_EQ(status_with({}), 2);
  EXPECT_EQ(status_with({"--iso", "3", "--background", "1"}), 2);
  EXPECT_EQ(status_with({"--iso", "3", "--labels", "1"}), 2);
  EXPECT_EQ(status_with({"--labels", "all"}), 2);  // a .drc holds one label
  EXPECT_EQ(status_with({"--labels", "1"}), -1);
  EXPECT_EQ(status_with({"--labels", "one"}), 2);
  EXPECT_EQ(status_with({"--labels", "1", "--label-name", "Liver"}), 2);
  EXPECT_EQ(status_with({"--labels", "1", "--interpolation", "linear"}), 2);
  EXPECT_EQ(status_with({"--labels", "1", "--regularize"}), -1);
}

}  // namespace
}  // namespace isomesh::cli
