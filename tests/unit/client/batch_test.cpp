// Tests of which inputs are meshed separately, and of the names of their outputs.
#include "client/cli/batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/error.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Batch : public testing::Test {
 protected:
  std::filesystem::path file(const std::string& name, const std::string& text = "x") {
    const auto path = folder_.path() / name;
    std::filesystem::create_directories(path.parent_path());
    test::write_file(path, text);
    return path;
  }

  std::vector<std::string> names_of(const std::vector<std::filesystem::path>& files) const {
    Options options;
    options.files = files;
    options.outputs = {{"{name}.stl", MeshFormat::kStl}};
    std::vector<std::string> names;
    for (const Input& input : inputs_of(options)) names.push_back(input.name);
    return names;
  }

  test::TemporaryFolder folder_;
};

TEST_F(Batch, AnInputIsCalledAsItsFileWithoutSuffixes) {
  EXPECT_EQ(name_of_input("scans/head.nii.gz"), "head");
  EXPECT_EQ(name_of_input("head.v2.nrrd"), "head.v2");
  EXPECT_EQ(name_of_input("HEAD.NII.GZ"), "HEAD");
  EXPECT_EQ(name_of_input("head"), "head");
  EXPECT_EQ(name_of_input("-"), "stdin");
  EXPECT_EQ(name_of_input("a\x1b[31m.nii"), "a\uFFFD[31m") << "it is printed";
  file("series.1/one.dcm");
  EXPECT_EQ(name_of_input(folder_.path() / "series.1"), "series.1");
  EXPECT_EQ(name_of_input((folder_.path() / "series.1").string() + "/"), "series.1");
}

TEST_F(Batch, FilesAreOneUploadUnlessOutputsHaveNames) {
  Options options;
  options.files = {file("a.nii"), file("b.nii")};
  options.outputs = {{"mesh.stl", MeshFormat::kStl}};
  EXPECT_THAT(inputs_of(options), ElementsAre(Input{options.files, "a"}));
  EXPECT_THAT(names_of(options.files), ElementsAre("a", "b"));
}

TEST_F(Batch, WhatAnotherInputSendsIsNoInput) {
  const auto header = file("a.mhd", "ElementDataFile = a.raw\n");
  const auto data = file("a.raw");
  EXPECT_THAT(names_of({header, data}), ElementsAre("a"));
  EXPECT_THAT(names_of({data, header}), ElementsAre("a"));
  const auto pair = file("b.hdr");
  const auto image = file("b.img");
  EXPECT_THAT(names_of({image, file("c.nii"), pair}), ElementsAre("b", "c"));
  EXPECT_THAT(names_of({pair, pair}), ElementsAre("b"));
  const auto head = file("d+orig.HEAD");
  EXPECT_THAT(names_of({head, file("d+orig.BRIK")}), ElementsAre("d+orig"));
  const auto rec = file("e.REC");
  EXPECT_THAT(names_of({file("e.PAR"), rec}), ElementsAre("e"));
}

TEST_F(Batch, TwoOfOneNameAreRefused) {
  try {
    names_of({file("x/a.nii"), file("y/a.nrrd")});
    FAIL() << "they are not refused";
  } catch (const EarlyExit& refused) {
    EXPECT_EQ(refused.status(), kWrongUsage);
    EXPECT_THAT(refused.what(), HasSubstr("two inputs are called a"));
  }
  EXPECT_THROW(names_of({file("tab\x01.nii"), file("tab\x02.nii")}), EarlyExit)
      << "both outputs would have U+FFFD in their names";
}

TEST_F(Batch, AHeaderThatCannotBeReadIsAnInput) {
  std::filesystem::create_symlink("loop.mhd", folder_ / "loop.mhd");
  std::filesystem::create_symlink("absent", folder_ / "absent.nhdr");
  EXPECT_THAT(names_of({file("a.nii"), folder_ / "loop.mhd", folder_ / "absent.nhdr"}),
              ElementsAre("a", "loop", "absent"));
}

TEST_F(Batch, MembersAreCalledAsTheirFilesAndWithTheirFoldersOnlyIfNeeded) {
  EXPECT_THAT(names_of_members("s", {"a/ct.nrrd", "b/mr.nii.gz", "*.dcm"}),
              ElementsAre("s-ct", "s-mr", "s-*"));
  EXPECT_THAT(names_of_members("s", {"a/ct.nrrd", "b/ct.nii.gz", "b/mr.nii"}),
              ElementsAre("s-a_ct", "s-b_ct", "s-mr"));
  EXPECT_THAT(names_of_members("s", {"ct.nrrd", "ct.nii.gz"}),
              ElementsAre("s-ct.nrrd", "s-ct.nii.gz"));
  EXPECT_THAT(names_of_members("s", {"x/a/ct.nrrd", "x/b/c/ct.nrrd", "x/ct.nrrd", "x/mr.nii"}),
              ElementsAre("s-a_ct", "s-b_c_ct", "s-ct", "s-mr"))
      << "without the folders that they share";
}

TEST_F(Batch, NoTwoMembersHaveOneName) {
  EXPECT_THAT(names_of_members("s", {"a/ct.nrrd", "b/ct.nrrd", "x/a_ct.nrrd"}),
              ElementsAre("s-a_ct.nrrd", "s-b_ct", "s-a_ct"));
  EXPECT_THAT(names_of_members("s", {"c/a/b.nii", "c/a_b.nii", "d/a_b.nii", "d/b.nii"}),
              ElementsAre("s-c_a_b.nii", "s-c_a_b.nii-2", "s-d_a_b", "s-d_b"));
  EXPECT_THAT(names_of_members("s", {"a\x01.nii", "a\x02.nii"}),
              ElementsAre("s-a\uFFFD.nii", "s-a\uFFFD.nii-2"));
}

TEST_F(Batch, LongNamesOfMembersAreCut) {
  const std::string folders = std::string(100, 'f') + '/' + std::string(100, 'g') + '/';
  EXPECT_THAT(names_of_members("s", {folders + "left/ct.nrrd", folders + "right/ct.nrrd"}),
              ElementsAre("s-left_ct", "s-right_ct"));
  const std::string cut = "s-" + std::string(198, 'f');
  EXPECT_THAT(
      names_of_members("s", {"a/" + folders + "ct.nrrd", "b/" + folders + "ct.nrrd",
                             std::string(200, 'f') + "1.nii", std::string(200, 'f') + "2.nii"}),
      ElementsAre("s-a_" + std::string(100, 'f') + '_' + std::string(95, 'g'),
                  "s-b_" + std::string(100, 'f') + '_' + std::string(95, 'g'), cut,
                  cut.substr(0, 198) + "-2"));
}

TEST_F(Batch, EachNameIsTakenOnce) {
  TakenNames names;
  EXPECT_TRUE(names.take("s-x"));
  EXPECT_TRUE(names.take("s-y"));
  EXPECT_FALSE(names.take("s-x"));
}

TEST_F(Batch, NamesFillOutputsAndStayInTheirFolder) {
  const std::vector<Output> outputs = {{"out/{name}-{name}.stl", MeshFormat::kStl},
                                       {"-", MeshFormat::kStl}};
  EXPECT_EQ(filled(outputs, "a").front().path, "out/a-a.stl");
  EXPECT_EQ(filled(outputs, "../a").front().path, "out/.._a-.._a.stl");
  EXPECT_EQ(filled(outputs, "a\x1b[31m\a").front().path,
            "out/a\uFFFD[31m\uFFFD-a\uFFFD[31m\uFFFD.stl");
  EXPECT_EQ(filled(outputs, "{name}").front().path, "out/{name}-{name}.stl");
  EXPECT_TRUE(filled(outputs, "a").back().is_stdout());
}

}  // namespace
}  // namespace isomesh::cli
