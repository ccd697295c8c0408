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
}

TEST_F(Batch, EachNameIsTakenOnce) {
  TakenNames names;
  EXPECT_EQ(names.take({"s", "s-x"}), std::nullopt);
  EXPECT_EQ(names.take({"s-y", "s-x"}), "s-x");
  EXPECT_EQ(names.take({"s-y", "s-z", "s-z"}), "s-z");
  EXPECT_EQ(names.take({"s-a_b"}), std::nullopt);
  EXPECT_EQ(names.take({"s-a/b"}), "s-a/b") << "both are the same file";
  EXPECT_EQ(names.take({"s-y", "s-z"}), std::nullopt);
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
