// Tests of which inputs are meshed separately, and of the names of their outputs.
#include "client/cli/batch.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "client/cli/exit_status.h"
#include "client/cli/output_files.h"
#include "proto/error.h"
#include "proto/volume_formats.h"
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

  static std::vector<Input> inputs(const std::vector<std::filesystem::path>& files,
                                   const std::string& output = "{name}.stl") {
    Options options;
    options.files = files;
    options.outputs = {{output, MeshFormat::kStl}};
    return checked(options);
  }

  // As a run begins: no mesh replaces a file of the run.
  static std::vector<Input> checked(const Options& options) {
    std::vector<Input> inputs = inputs_of(options);
    RunFiles(options, inputs);
    return inputs;
  }

  static std::vector<std::string> names_of(const std::vector<std::filesystem::path>& files) {
    std::vector<std::string> names;
    for (const Input& input : inputs(files)) names.push_back(input.names.name);
    return names;
  }

  // The paths that the meshes of these files have.
  static std::vector<std::string> paths_of(const std::vector<std::filesystem::path>& files,
                                           const std::string& output) {
    std::vector<std::string> paths;
    for (const Input& input : inputs(files, output)) {
      paths.push_back(filled({{output, MeshFormat::kStl}}, input.names).front().path);
    }
    return paths;
  }

  static std::string refusal_of(const std::vector<std::filesystem::path>& files,
                                const std::string& output = "{name}.stl") {
    Options options;
    options.files = files;
    options.outputs = {{output, MeshFormat::kStl}};
    return refusal_of(options);
  }

  static std::string refusal_of(const Options& options) {
    try {
      checked(options);
    } catch (const EarlyExit& refused) {
      EXPECT_EQ(refused.status(), kWrongUsage);
      return refused.what();
    }
    return "";
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

// Python's batches have a test of the same, with the same file of cases.
TEST_F(Batch, AFileOfEachFormatIsCalledWithoutItsSuffixes) {
  for (const VolumeFormat& format : volume_formats()) {
    for (const std::string_view suffix : words(format.suffixes)) {
      EXPECT_EQ(name_of_input("scans/x" + std::string(suffix)), "x") << suffix;
    }
  }
  std::ifstream cases(ISOMESH_NAMES);
  std::string file;
  std::string name;
  int count = 0;
  for (; cases >> file >> name; ++count) EXPECT_EQ(name_of_input(file), name) << file;
  EXPECT_GT(count, 9);
}

TEST_F(Batch, FilesAreOneUploadUnlessOutputsHaveNames) {
  Options options;
  options.files = {file("a.nii"), file("b.nii")};
  options.outputs = {{"mesh.stl", MeshFormat::kStl}};
  EXPECT_THAT(inputs_of(options), ElementsAre(Input{options.files, {"a"}}));
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

TEST_F(Batch, InputsOfOneNameHaveTheFoldersThatTellThemApart) {
  EXPECT_THAT(names_of({file("sub-01/anat/T1.nii.gz"), file("sub-02/anat/T1.nii.gz"),
                        file("sub-01/anat/FLAIR.nii.gz")}),
              ElementsAre("sub-01_anat_T1", "sub-02_anat_T1", "FLAIR"));
  EXPECT_THAT(names_of({file("x/a.nii"), file("y/a.nrrd")}), ElementsAre("x_a", "y_a"));
  EXPECT_THAT(names_of({file("x/a.nii"), file("x/b/a.nii"), file("a.nii")}),
              ElementsAre("x_a", "x_b_a", "a"));
  EXPECT_THAT(names_of({file("x/a.nii"), file("x/a.nrrd")}), ElementsAre("a.nii", "a.nrrd"));
  file("s1/ct.1/one.dcm");
  file("s2/ct.1/one.dcm");
  EXPECT_THAT(names_of({folder_ / "s1/ct.1", folder_ / "s2/ct.1/"}),
              ElementsAre("s1_ct.1", "s2_ct.1"));
}

TEST_F(Batch, TheFolderOfAnInputIsTheOneBelowAllFolders) {
  const std::vector<std::filesystem::path> files = {file("sub-01/anat/T1.nii.gz"),
                                                    file("sub-02/anat/T1.nii.gz")};
  EXPECT_THAT(paths_of(files, "{folder}_{name}.stl"),
              ElementsAre("sub-01_anat_T1.stl", "sub-02_anat_T1.stl"));
  EXPECT_THAT(paths_of(files, "out/{folder}/{name}.stl"),
              ElementsAre("out/sub-01/anat/T1.stl", "out/sub-02/anat/T1.stl"));
  EXPECT_THAT(paths_of(files, "{folder}.stl"), ElementsAre("sub-01_anat.stl", "sub-02_anat.stl"));
  EXPECT_THAT(paths_of({files.front()}, "{folder}-{name}.stl"), ElementsAre("anat-T1.stl"));
  EXPECT_THAT(paths_of({file("x/a.nii"), file("x/b.nii")}, "{folder}-{name}.stl"),
              ElementsAre("x-a.stl", "x-b.stl"));
  EXPECT_THAT(paths_of({file("t\x01/a.nii"), file("u/a.nii")}, "o/{folder}/{name}.stl"),
              ElementsAre("o/t\uFFFD/a.stl", "o/u/a.stl"));
  EXPECT_THAT(refusal_of({"3f2a91c0", files.front()}, "{folder}.stl"),
              HasSubstr("3f2a91c0 is in no folder"));
}

TEST_F(Batch, InputsThatWouldOverwriteEachOtherAreRefusedByName) {
  const auto one = file("tab\x01.nii");
  const auto other = file("tab\x02.nii");
  file("a/b_c/x.nii");
  EXPECT_THAT(refusal_of({one, other}),
              HasSubstr(printable(one.string()) + " and " + printable(other.string())))
      << "both outputs would have U+FFFD in their names, and so have the files in the message";
  const auto left = file("a/b_c/x.nii");
  const auto right = file("a_b/c/x.nii");
  EXPECT_THAT(refusal_of({left, right}), testing::AllOf(HasSubstr(left), HasSubstr(right)));
  EXPECT_THAT(paths_of({left, right}, "{folder}/{name}.stl"),
              ElementsAre("a/b_c/x.stl", "a_b/c/x.stl"));
  const auto twin = file("a/b_c/y.nii");
  EXPECT_THAT(refusal_of({left, twin}, "{folder}.stl"),
              testing::AllOf(HasSubstr(left), HasSubstr(twin)));
}

TEST_F(Batch, LongNamesOfInputsStay) {
  const std::string name(240, 'n');
  EXPECT_THAT(names_of({file(name + "1.nii"), file(name + "2.nii")}),
              ElementsAre(name + "1", name + "2"));
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

TEST_F(Batch, EachOutputIsTakenOnce) {
  RunFiles files({}, {});
  const auto is_taken = [&](const std::vector<Output>& outputs, const std::string& owner) {
    const auto clash = files.take(outputs, owner);
    EXPECT_TRUE(!clash || clash->owner == "one");
    return !clash;
  };
  EXPECT_TRUE(is_taken({{"x.stl", MeshFormat::kStl}, {"x.glb", MeshFormat::kGlb}}, "one"));
  EXPECT_TRUE(is_taken({{"x.stl", MeshFormat::kStl}}, "one"));
  EXPECT_FALSE(is_taken({{"y.stl", MeshFormat::kStl}, {"./x.glb", MeshFormat::kGlb}}, "two"));
  EXPECT_TRUE(is_taken({{"y.stl", MeshFormat::kStl}}, "two"));
}

TEST_F(Batch, MaterialsAreFilesOfAMesh) {
  Options options;
  options.files = {file("a b.nii"), file("a_b.nii")};
  options.outputs = {{folder_ / "{name}.obj", MeshFormat::kObj}};
  EXPECT_EQ(refusal_of(options), "") << "without labels there are none";
  options.parameters.labels.emplace();
  EXPECT_THAT(refusal_of(options),
              testing::AllOf(HasSubstr(options.files[0]), HasSubstr(options.files[1]),
                             HasSubstr(folder_ / "a_b.mtl")));
  // A volume is recognised by its content, so it may have any name.
  options.files = {file("c.nii"), file("c.mtl")};
  EXPECT_THAT(refusal_of(options), HasSubstr("would overwrite the volume"));
}

TEST_F(Batch, LinksAreTheFilesThatTheyLeadTo) {
  std::filesystem::create_directories(folder_ / "real");
  std::filesystem::create_directory_symlink("real", folder_ / "link");
  std::filesystem::create_symlink("real/z.stl", folder_ / "z.stl");
  RunFiles files({}, {});
  EXPECT_FALSE(files.take({{folder_ / "real/x.stl", MeshFormat::kStl}}, "one"));
  EXPECT_TRUE(files.take({{folder_ / "link/x.stl", MeshFormat::kStl}}, "two"));
  EXPECT_FALSE(files.take({{folder_ / "real/z.stl", MeshFormat::kStl}}, "one"));
  EXPECT_TRUE(files.take({{folder_ / "z.stl", MeshFormat::kStl}}, "two"));
}

// The names of an archive's members are known after its upload.
TEST_F(Batch, NoMeshOfAMemberReplacesAnInput) {
  Options options;
  options.files = {file("arch.zip"), file("other.vtk"), file("set/one.vtk")};
  // A folder that cannot be uploaded keeps its files, too.
  options.files.back() = options.files.back().parent_path();
  std::filesystem::create_symlink("nowhere", folder_ / "set/dangling");
  options.outputs = {{folder_ / "meshes-{name}.vtk", MeshFormat::kVtk}};
  const std::vector<Input> inputs = inputs_of(options);
  RunFiles files(options, inputs);
  for (const std::string volume : {"other.vtk", "set/one.vtk"}) {
    const auto clash = files.take({{folder_ / volume, MeshFormat::kVtk}}, "arch: other.nii");
    ASSERT_TRUE(clash) << volume;
    EXPECT_EQ(clash->owner, "");
  }
}

class UpToDate : public Batch {
 protected:
  // `hours` after the others.
  std::filesystem::path at(int hours, const std::string& name, const std::string& text = "x") {
    auto path = file(name, text);
    std::filesystem::last_write_time(path, begin_ + std::chrono::hours(hours));
    return path;
  }

  bool is(const std::vector<std::filesystem::path>& files,
          const std::vector<std::filesystem::path>& outputs) const {
    return is_up_to_date({files, {}}, outputs);
  }

  std::filesystem::file_time_type begin_ =
      std::filesystem::file_time_type::clock::now() - std::chrono::hours(100);
};

TEST_F(UpToDate, IsAnInputWhoseOutputsAreAllNewer) {
  const auto input = at(1, "a.nii");
  const auto newer = at(2, "a.stl");
  EXPECT_TRUE(is({input}, {newer}));
  EXPECT_TRUE(is({input}, {newer, at(3, "a.glb")}));
  EXPECT_FALSE(is({input}, {newer, at(0, "b.glb")}));
  EXPECT_FALSE(is({input}, {newer, folder_ / "absent.glb"}));
  EXPECT_FALSE(is({input}, {at(1, "same.stl")}));
  EXPECT_FALSE(is({input}, {folder_.path()}));
  EXPECT_FALSE(is({input}, {}));
}

TEST_F(UpToDate, ComparesAllFilesOfAnInput) {
  at(1, "series/one.dcm");
  at(3, "series/deep/two.dcm");
  EXPECT_FALSE(is({folder_ / "series"}, {at(2, "series.stl")}));
  EXPECT_TRUE(is({folder_ / "series"}, {at(4, "series.stl")}));
  const auto header = at(1, "b.mhd", "ElementDataFile = b.raw\n");
  at(3, "b.raw");
  EXPECT_FALSE(is({header}, {at(2, "b.stl")}));
  EXPECT_FALSE(is({at(1, "c.hdr"), at(3, "c.img")}, {at(2, "c.stl")}));
}

TEST_F(UpToDate, IsAStoredVolumeThatHasItsOutputButNeverStandardInput) {
  EXPECT_TRUE(is({"3f2a91c0"}, {at(0, "a.stl")}));
  EXPECT_FALSE(is({"3f2a91c0"}, {folder_ / "absent.stl"}));
  EXPECT_FALSE(is({"-"}, {at(0, "a.stl")}));
}

TEST_F(Batch, NamesFillOutputsAndStayInTheirFolder) {
  const std::vector<Output> outputs = {{"out/{name}-{name}.stl", MeshFormat::kStl},
                                       {"-", MeshFormat::kStl}};
  EXPECT_EQ(filled(outputs, {"a"}).front().path, "out/a-a.stl");
  EXPECT_EQ(filled(outputs, {"../a"}).front().path, "out/.._a-.._a.stl");
  EXPECT_EQ(filled(outputs, {"a\x1b[31m\a"}).front().path,
            "out/a\uFFFD[31m\uFFFD-a\uFFFD[31m\uFFFD.stl");
  EXPECT_EQ(filled(outputs, {"{name}{folder}"}).front().path,
            "out/{name}{folder}-{name}{folder}.stl");
  EXPECT_TRUE(filled(outputs, {"a"}).back().is_stdout());
}

}  // namespace
}  // namespace isomesh::cli
