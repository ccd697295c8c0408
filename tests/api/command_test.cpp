// The command against a real daemon: meshes, batches, pipes, refusals.
#include "tests/api/command.h"

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/support/draco_decoder.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

namespace fs = std::filesystem;

TEST_F(CommandTest, MeshWritesTheMeshesAndPrintsTheTimingTable) {
  const Finished result = command("mesh @sphere.raw $raw --iso 100 -o @out.drc -o @out.stl");
  ASSERT_EQ(result.status, 0) << result.errors;
  for (const std::string word :
       {"upload", "queue", "load", "extract", "smooth", "encode", "total", "download"}) {
    EXPECT_THAT(result.output, HasSubstr(word));
  }
  const Job job = daemon_.client().jobs().jobs.at(0);
  const DecodedMesh decoded = decode_with_command(read_file(folder_ / "out.drc"));
  EXPECT_EQ(decoded.triangles.size(), job.mesh->triangles);
  EXPECT_EQ(decoded.points.size(), job.mesh->vertices);
  EXPECT_EQ(read_file(folder_ / "out.stl").size(), 84 + 50 * job.mesh->triangles);
}

TEST_F(CommandTest, MeshPassesEveryOptionOn) {
  const Finished result = command(
      "mesh @sphere.raw $raw --iso 120 --scheme 5 --interpolation midpoint --passes 2 --smoothing "
      "laplacian --lambda 0.5 --position-bits 12 --speed 3 --priority stat --spacing 1,1,2 "
      "--digest --json -o @out.drc");
  ASSERT_EQ(result.status, 0) << result.errors;
  const Job job = job_from_json(result.output);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(job.parameters.iso, 120);
  EXPECT_EQ(job.parameters.scheme, SchemeName::kFive);
  EXPECT_EQ(job.parameters.interpolation, Interpolation::kMidpoint);
  EXPECT_EQ(job.parameters.passes, 2);
  EXPECT_EQ(job.parameters.lambda, 0.5);
  EXPECT_EQ(job.parameters.draco, (DracoParameters{12, 3}));
  EXPECT_EQ(job.parameters.priority, Priority::kStat);
  EXPECT_EQ(daemon_.client().volume(job.parameters.volume).geometry.spacing[2], 2);
  EXPECT_EQ(json::parse(result.output)["outputs"][0], (folder_ / "out.drc").string());
}

TEST_F(CommandTest, AKeyIsOneJob) {
  EXPECT_EQ(submit("--key a"), submit("--key a"));
  EXPECT_NE(submit(), submit());
}

TEST_F(CommandTest, StepByStep) {
  const std::string volume = upload();
  EXPECT_EQ(upload(), volume);
  const Finished info = command("info " + volume);
  EXPECT_EQ(info.status, 0);
  EXPECT_THAT(info.output, HasSubstr("21 x 20 x 19"));
  EXPECT_THAT(info.output, HasSubstr("\u2588"));  // the histogram's highest bar

  const Finished labels = command("labels --background -1 " + volume);
  EXPECT_EQ(labels.status, 0);
  EXPECT_THAT(labels.output, HasSubstr("voxels"));
  const auto listed = volume_labels_from_json(command("--json labels " + volume).output);
  EXPECT_EQ(listed.volume, volume);
  EXPECT_FALSE(listed.labels.empty());
  const Finished estimate = command("estimate --iso 100 --format stl " + volume);
  EXPECT_EQ(estimate.status, 0) << estimate.errors;
  EXPECT_THAT(estimate.output, HasSubstr("triangles"));

  const std::string job = submit("--format drc,stl");
  const Finished wait = command("wait " + job);
  EXPECT_EQ(wait.status, 0) << wait.errors;
  EXPECT_THAT(wait.output, HasSubstr("succeeded"));
  EXPECT_THAT(command("status " + job).output, HasSubstr("triangles"));

  EXPECT_EQ(command("fetch -o @a.drc -o @a.stl " + job).status, 0);
  EXPECT_TRUE(read_file(folder_ / "a.drc").starts_with("DRACO"));
  EXPECT_TRUE(fs::exists(folder_ / "a.stl"));

  EXPECT_THAT(command("list").output, HasSubstr(job));
  EXPECT_THAT(command("list --state failed").output, testing::Not(HasSubstr(job)));
  EXPECT_THAT(command("list --volumes").output, HasSubstr(volume));
}

TEST_F(CommandTest, JsonIsTheServersOwn) {
  const Volume volume = volume_from_json(command("--json upload @sphere.raw $raw").output);
  EXPECT_EQ(volume_from_json(command("--json info " + volume.id).output), volume);
  const Job submitted = job_from_json(command("--json submit --iso otsu " + volume.id).output);
  const Job ended = job_from_json(command("--json wait " + submitted.id).output);
  EXPECT_EQ(ended.state, JobState::kSucceeded);
  EXPECT_EQ(ended.parameters.iso, std::nullopt);
  EXPECT_EQ(job_from_json(command("--json status " + ended.id).output), ended);
  EXPECT_EQ(jobs_from_json(command("--json list").output), std::vector{ended});
  EXPECT_EQ(volumes_from_json(command("--json list --volumes").output), std::vector{volume});
}

TEST_F(CommandTest, CancelStopsARunningJob) {
  const Job job = long_job(daemon_);
  EXPECT_EQ(command("cancel " + job.id).status, 0);
  EXPECT_EQ(command("wait " + job.id).status, 1);
  EXPECT_EQ(daemon_.client().job(job.id).state, JobState::kCancelled);
}

TEST_F(CommandTest, WhatTheServerRefusesIsStatus1WithItsReason) {
  write_file(folder_ / "garbage.nii", "garbage");
  const std::vector<std::pair<std::string, std::string>> refusals = {
      {"upload @garbage.nii", "NIfTI"},
      {"mesh @garbage.nii --iso 1 -o @out.drc", "NIfTI"},
      {"status 0123", "no job"},
      {"wait 0123", "no job"},
      {"cancel 0123", "no job"},
      {"fetch 0123 -o @out.drc", "no job"},
      {"info 0123", "no volume"},
      {"submit 0123 --iso 1", "no volume"},
      {"submit --iso bone " + upload(), "no preset"},
      {"fetch -o @out.stl " + submit(), ""}};
  for (const auto& [line, reason] : refusals) {
    const Finished result = command(line);
    EXPECT_EQ(result.status, 1) << line;
    EXPECT_THAT(result.errors, HasSubstr(reason));
    EXPECT_EQ(result.output, "");
  }
  EXPECT_FALSE(fs::exists(folder_ / "out.drc"));
}

TEST_F(CommandTest, ABatchGoesOnWhenOneFails) {
  volume("in/a.raw");
  volume("in/c.raw");
  write_file(folder_ / "in/b.raw", "too short");
  const Finished result = command(
      "mesh @in/a.raw @in/b.raw @in/c.raw $raw --iso 100 -o @out/ --format stl,obj --jobs 2");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: b: "));
  EXPECT_THAT(result.errors, HasSubstr("1 of 3 inputs failed"));
  EXPECT_THAT(outputs(), ElementsAre("a.obj", "a.stl", "c.obj", "c.stl"));
}

TEST_F(CommandTest, NoMeshOfARunOverwritesAnother) {
  write_pair("study/a/ct");
  write_pair("study/b/ct");
  const Finished result = command("mesh @study --iso 100 -o @out/ --format stl");
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_THAT(outputs(), ElementsAre("study-a_ct.stl", "study-b_ct.stl"));
  EXPECT_THAT(command("mesh @study --iso 300 -o @{name}.obj").errors,
              HasSubstr("isomesh: study: b/ct.mhd: the surface is empty"));

  write_pair("s/x");
  write_pair("s/y");
  write_pair("s-x");
  const Finished twice = command("mesh @s @s-x.mhd --iso 100 -o @out/ --format obj");
  EXPECT_EQ(twice.status, 1);
  EXPECT_THAT(twice.errors, HasSubstr("isomesh: s: x.mhd: two meshes would be written to "));
  EXPECT_THAT(twice.errors, HasSubstr("--member x.mhd"));
  EXPECT_THAT(outputs(), ElementsAre("s-x.obj", "s-y.obj", "study-a_ct.stl", "study-b_ct.stl"));
}

// Its names are known after the upload, while other inputs may still wait for theirs.
TEST_F(CommandTest, NoMeshOfAnArchivesVolumeReplacesAnInput) {
  write_pair("s/x");
  write_pair("s/y");
  write_file(folder_ / "s-x-b.vtk", "a volume");
  const Finished result = command("mesh @s @s-x-b.vtk --iso 100 -o @{name}-b.vtk");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: x.mhd: the mesh would overwrite the volume "));
  EXPECT_EQ(read_file(folder_ / "s-x-b.vtk"), "a volume");
  EXPECT_TRUE(fs::exists(folder_ / "s-y-b.vtk"));
}

TEST_F(CommandTest, AMemberThatCannotBeMeshedKeepsNoOtherFromIt) {
  write_pair("s/a/ct");
  write_pair("s/b/ct");
  write_file(folder_ / "s/b/ct.raw", "too short");
  write_pair("s/x");
  write_file(folder_ / "s/f.raw", std::string(sphere_.bytes.size() * 4, '\0'));
  write_file(folder_ / "s/f.mhd",
             "ObjectType = Image\nNDims = 3\nDimSize = 21 20 19\nElementType = MET_FLOAT\n"
             "ElementDataFile = f.raw\n");
  write_pair("s-x");
  const Finished result = command("mesh @s @s-x.mhd --labels all -o @out/ --format glb");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: b/ct.mhd: "));
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: f.mhd: "));
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: x.mhd: two meshes would be written to "));
  EXPECT_THAT(outputs(), ElementsAre("s-ct.glb", "s-x.glb"));
}

TEST_F(CommandTest, AnObjOfLabelsHasItsMaterialsBesideIt) {
  std::string samples(1000, '\0');
  for (const std::size_t at : {444, 445, 454, 455, 544, 545, 554, 555}) samples[at] = '\1';
  for (const std::size_t at : {446, 447, 456, 457, 546, 547, 556, 557}) samples[at] = '\2';
  write_file(folder_ / "two.raw", samples);
  fs::create_directory(folder_ / "out");
  const std::string mesh = "mesh @two.raw --dims 10,10,10 --type uint8 --spacing 1,1,1 ";
  const Finished made = command(mesh + "--labels all --label-color 2=#ff0080 -o @out/x.obj");
  EXPECT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(outputs(), ElementsAre("x.mtl", "x.obj"));
  const std::string obj = read_file(folder_ / "out/x.obj");
  EXPECT_TRUE(obj.starts_with("# isomesh, millimetres, SPACE=LPS\nmtllib x.mtl\no label_1\nv "));
  const std::string materials = read_file(folder_ / "out/x.mtl");
  EXPECT_THAT(materials, HasSubstr("newmtl label_2\nKd 1.000000 0.000000 0.501961\n"));
  EXPECT_THAT(made.output, HasSubstr("/out/x.mtl\n"));
  const Finished told = command("--json " + mesh + "--labels all -o @out/x.obj");
  EXPECT_THAT(told.output, HasSubstr("/out/x.mtl\"]"));
  command("--quiet " + mesh + "--labels all --label-color 2=#ff0080 -o @out/x.obj");
  // Nothing else of the file changes, and standard output gets it as the server has it.
  const Finished printed =
      command("--quiet " + mesh + "--labels all --label-color 2=#ff0080 -o - --format obj");
  std::string served = obj;
  served.replace(served.find("x.mtl"), 5, "mesh.mtl");
  EXPECT_EQ(printed.output, served);
  command(mesh + "--iso 0.5 -o @out/y.obj");
  EXPECT_THAT(outputs(), ElementsAre("x.mtl", "x.obj", "y.obj"));
}

TEST_F(CommandTest, AFolderHasAGiftiUnderANameThatTellsThatItIsASurface) {
  EXPECT_EQ(command("mesh @sphere.raw $raw --iso 100 -o @out/ --format gii").status, 0);
  EXPECT_THAT(outputs(), ElementsAre("sphere.surf.gii"));
}

TEST_F(CommandTest, ADryRunLeavesNothingBehind) {
  const std::string dry_run = "mesh @sphere.raw $raw --dry-run --iso ";
  const Finished dry = command(dry_run + "100 --format stl");
  EXPECT_EQ(dry.status, 0) << dry.errors;
  EXPECT_THAT(dry.output, HasSubstr("triangles"));
  EXPECT_EQ(command(dry_run + "bone").status, 1);
  // Twice the same volume, which one of them stores and both of them need.
  fs::copy(folder_ / "sphere.raw", folder_ / "again.raw");
  const Finished both = command(dry_run + "100 @again.raw --jobs 2 -o @{name}.stl");
  EXPECT_EQ(both.status, 0) << both.errors;
  EXPECT_TRUE(daemon_.client().volumes().empty());
  EXPECT_TRUE(daemon_.client().jobs().jobs.empty());
  upload();
  command(dry_run + "100");
  EXPECT_EQ(daemon_.client().volumes().size(), 1U) << "it was there before";
}

TEST_F(CommandTest, SaysWhenItsOutputCannotBeWritten) {
  const std::string mesh = ISOMESH " mesh @sphere.raw $raw --iso 100 -o - --format stl";
  const std::string list = ISOMESH " list";
  const std::string config = ISOMESHD " config";
  for (const std::string& line : {mesh, list, std::string(ISOMESH " --help"),
                                  std::string(ISOMESH " completion bash"), config}) {
    for (const std::string output : {" > /dev/full", " >&-"}) {
      const Finished full = shell(line + output);
      EXPECT_EQ(full.status, 1) << line;
      EXPECT_THAT(full.errors, HasSubstr("standard output cannot be written to"));
    }
    EXPECT_EQ(shell(line + " >&- 2>&-").status, 1) << line;
  }
  EXPECT_EQ(shell(ISOMESH " mesh - $raw --iso 100 -o @closed.stl <&-").status, 1);
  EXPECT_EQ(shell(mesh + " 2>&- <&-").output, shell(mesh).output);
  EXPECT_EQ(shell(list).status, 0);
}

TEST_F(CommandTest, ExplainsAWrongNameInItsOwnWords) {
  const std::string id = upload();
  for (const std::string& name :
       {std::string("new\nname"), std::string(256, 'a'), std::string(" ")}) {
    const Finished wrong = daemon_.command({"rename", id, name});
    EXPECT_EQ(wrong.status, 1);
    EXPECT_EQ(wrong.errors,
              "isomesh: NAME must have 1 to 255 bytes on one line, or be \"\", which removes the "
              "name\n");
  }
}

TEST_F(CommandTest, LeavesNothingOfAMeshBeyondTheFileSizeLimit) {
  fs::create_directory(folder_ / "out");
  const Finished result =
      shell("ulimit -f 1; " ISOMESH " mesh @sphere.raw $raw --iso 100 -o @out/sphere.stl");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("sphere.stl: File too large"));
  EXPECT_THAT(outputs(), testing::IsEmpty());
}

TEST_F(CommandTest, EraseTakesVolumesAndTellsOfThoseThatAreNone) {
  const Finished erased = command("erase 0123 " + upload());
  EXPECT_EQ(erased.status, 1);
  EXPECT_THAT(erased.errors, HasSubstr("0123: "));
  EXPECT_TRUE(daemon_.client().volumes().empty());
}

TEST_F(CommandTest, ReadsAndWritesPipes) {
  ASSERT_EQ(command("mesh @sphere.raw $raw --iso 100 -q -o @file.stl").status, 0);
  const std::string whole = read_file(folder_ / "file.stl");
  const Finished piped =
      shell("cat @sphere.raw | " ISOMESH " mesh - $raw --iso 100 -o - --format stl");
  EXPECT_EQ(piped.status, 0) << piped.errors;
  EXPECT_EQ(piped.output, whole);
  EXPECT_EQ(daemon_.client().volumes().back().name, "sphere.raw");

  const Finished uploaded = shell("tr '\\000' '\\001' < @sphere.raw | " ISOMESH " upload - $raw");
  EXPECT_EQ(uploaded.status, 0) << uploaded.errors;
  EXPECT_EQ(daemon_.client().volume(uploaded.line()).name, "stdin");

  // These cannot be replaced by a whole file.
  const Finished device =
      shell(ISOMESH " mesh @sphere.raw $raw --iso 100 -o /dev/stdout --format stl");
  EXPECT_EQ(device.status, 0) << device.errors;
  EXPECT_EQ(device.output, whole);
  const Finished pipe = shell("mkfifo @fifo.stl; cat @fifo.stl & " ISOMESH
                              " mesh @sphere.raw $raw --iso 100 -q -o @fifo.stl && wait");
  EXPECT_EQ(pipe.status, 0) << pipe.errors;
  EXPECT_EQ(pipe.output, whole);
  EXPECT_TRUE(fs::is_fifo(folder_ / "fifo.stl"));
}

// A client may use half of the daemon's places, which are far fewer.
TEST_F(CommandTest, MoreAtOnceThanTheDaemonTakesAllSucceed) {
  std::vector<std::string> words = words_of("mesh $raw -o @out/ --iso 100 --passes 0 --jobs 32");
  for (int n = 0; n < 40; ++n) words.push_back(volume("in/" + std::to_string(n) + ".raw"));
  const Finished result = daemon_.command(words);
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.errors, "");
  EXPECT_EQ(outputs().size(), 40U);
}

TEST_F(CommandTest, SkipsWhatIsDone) {
  std::vector<std::string> files;
  for (const std::string subject : {"1", "2", "3", "4", "5"}) {
    files.push_back(volume("sub-" + subject + "/T1.raw"));
    fs::last_write_time(files.back(), fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  const std::string options =
      "mesh $raw --iso 100 -o @out/{folder}/{name}.stl -o @out/{folder}/{name}.glb --jobs 3 "
      "--json --skip-existing";
  const std::vector<std::string> words = with(words_of(options), files);
  const Finished first = daemon_.command(words);
  EXPECT_EQ(first.status, 0) << first.errors;
  EXPECT_THAT(first.errors, HasSubstr("skipped 0 of 5 inputs"));
  EXPECT_EQ(outputs().size(), 10U);
  const auto jobs = [&] { return daemon_.client().jobs().jobs.size(); };
  EXPECT_EQ(jobs(), 5U);

  // One mesh is missing, one input was replaced.
  fs::remove(folder_ / "out/sub-2/T1.glb");
  fs::last_write_time(files[3], fs::file_time_type::clock::now() + std::chrono::hours(1));
  const Finished again = daemon_.command(words);
  EXPECT_EQ(again.status, 0) << again.errors;
  EXPECT_THAT(again.errors, HasSubstr("skipped 3 of 5 inputs, whose meshes are newer"));
  EXPECT_EQ(outputs().size(), 10U);
  EXPECT_EQ(jobs(), 7U);
  std::set<std::string> skipped;
  std::set<std::string> made;
  for (const std::string_view line : lines(again.output)) {
    const json told = json::parse(line);
    (told.contains("skipped") ? skipped : made).insert(told.at("input").get<std::string>());
  }
  EXPECT_THAT(skipped, ElementsAre(files[0], files[2], files[4]));
  EXPECT_THAT(made, ElementsAre(files[1], files[3]));
}

TEST_F(CommandTest, SkipsTheVolumesOfAFolderThatAreDone) {
  write_pair("study/x");
  write_pair("study/y");
  const std::string line = "mesh @study --iso 100 -o @out/ --skip-existing";
  EXPECT_EQ(command(line).status, 0);
  EXPECT_THAT(outputs(), ElementsAre("study-x.drc", "study-y.drc"));
  fs::remove(folder_ / "out/study-y.drc");
  const Finished again = command(line);
  EXPECT_EQ(again.status, 0) << again.errors;
  EXPECT_THAT(again.errors, HasSubstr("study: x.mhd: skipped"));
  EXPECT_THAT(outputs(), ElementsAre("study-x.drc", "study-y.drc"));
  EXPECT_EQ(daemon_.client().jobs().jobs.size(), 3U);
}

}  // namespace
}  // namespace isomesh
