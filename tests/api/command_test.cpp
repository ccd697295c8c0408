// The real command against the real daemon.
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/support/draco_decoder.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;

class CommandTest : public testing::Test {
 protected:
  CommandTest() { write_file(folder_ / "sphere.raw", sphere_.bytes); }

  // `words` and the options that describe the sphere.
  std::vector<std::string> raw(const std::vector<std::string>& words) {
    return with(words, sphere_.options);
  }

  // A header and its samples, which differ from those in other places.
  void write_pair(const std::filesystem::path& path) {
    const std::string name = path.filename().string();
    std::filesystem::create_directories(path.parent_path());
    write_file(path.string() + ".mhd",
               "ObjectType = Image\nNDims = 3\nDimSize = 21 20 19\nElementType = MET_UCHAR\n"
               "ElementDataFile = " +
                   name + ".raw\n");
    std::string bytes = sphere_.bytes;
    bytes.front() = name.back();
    bytes.back() = path.parent_path().string().back();
    write_file(path.string() + ".raw", bytes);
  }

  std::string upload() {
    const Finished result = daemon_.command(raw({"upload", folder_ / "sphere.raw"}));
    EXPECT_EQ(result.status, 0) << result.errors;
    return result.line();
  }

  std::string submit(const std::vector<std::string>& options = {}) {
    const Finished result = daemon_.command(with({"submit", upload(), "--iso", "100"}, options));
    EXPECT_EQ(result.status, 0) << result.errors;
    return result.line();
  }

  Daemon daemon_;
  TemporaryFolder folder_;
  const RawUpload sphere_ = sphere_upload();
};

TEST_F(CommandTest, MeshWritesTheMeshAndPrintsTheTimingTable) {
  const Finished result = daemon_.command(
      raw({"mesh", folder_ / "sphere.raw", "--iso", "100", "-o", folder_ / "out.drc"}));
  ASSERT_EQ(result.status, 0) << result.errors;
  for (const std::string word :
       {"upload", "queue", "load", "extract", "smooth", "encode", "total", "download"}) {
    EXPECT_THAT(result.output, HasSubstr(word));
  }
  const Job job = daemon_.client().jobs().jobs.at(0);
  const DecodedMesh decoded = decode_with_command(read_file(folder_ / "out.drc"));
  EXPECT_EQ(decoded.triangles.size(), job.mesh->triangles);
  EXPECT_EQ(decoded.points.size(), job.mesh->vertices);
}

TEST_F(CommandTest, MeshTakesTheFormatFromTheSuffix) {
  const Finished result = daemon_.command(raw({"mesh", folder_ / "sphere.raw", "--iso", "100", "-o",
                                               folder_ / "out.stl", "-o", folder_ / "out.drc"}));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(read_file(folder_ / "out.drc").starts_with("DRACO"));
  const Job job = daemon_.client().jobs().jobs.at(0);
  EXPECT_EQ(read_file(folder_ / "out.stl").size(), 84 + 50 * job.mesh->triangles);
}

TEST_F(CommandTest, MeshPassesEveryOptionOn) {
  const Finished result = daemon_.command(raw({"mesh",
                                               folder_ / "sphere.raw",
                                               "--iso",
                                               "120",
                                               "--scheme",
                                               "5",
                                               "--interpolation",
                                               "midpoint",
                                               "--passes",
                                               "2",
                                               "--smoothing",
                                               "laplacian",
                                               "--lambda",
                                               "0.5",
                                               "--position-bits",
                                               "12",
                                               "--speed",
                                               "3",
                                               "--priority",
                                               "stat",
                                               "--spacing",
                                               "1,1,2",
                                               "--digest",
                                               "--json",
                                               "-o",
                                               folder_ / "out.drc"}));
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
  EXPECT_EQ(submit({"--key", "a"}), submit({"--key", "a"}));
  EXPECT_NE(submit(), submit());
}

TEST_F(CommandTest, StepByStep) {
  const std::string volume = upload();
  EXPECT_EQ(upload(), volume);
  const Finished info = daemon_.command({"info", volume});
  EXPECT_EQ(info.status, 0);
  EXPECT_THAT(info.output, HasSubstr("21 x 20 x 19"));
  EXPECT_THAT(info.output, HasSubstr("\u2588"));  // the histogram's highest bar

  const Finished labels = daemon_.command({"labels", volume, "--background", "-1"});
  EXPECT_EQ(labels.status, 0);
  EXPECT_THAT(labels.output, HasSubstr("voxels"));
  const auto listed = volume_labels_from_json(daemon_.command({"--json", "labels", volume}).output);
  EXPECT_EQ(listed.volume, volume);
  EXPECT_FALSE(listed.labels.empty());
  const Finished estimate =
      daemon_.command({"estimate", volume, "--iso", "100", "--format", "stl"});
  EXPECT_EQ(estimate.status, 0) << estimate.errors;
  EXPECT_THAT(estimate.output, HasSubstr("triangles"));

  const std::string job = submit({"--format", "drc,stl"});
  const Finished wait = daemon_.command({"wait", job});
  EXPECT_EQ(wait.status, 0) << wait.errors;
  EXPECT_THAT(wait.output, HasSubstr("succeeded"));
  EXPECT_THAT(daemon_.command({"status", job}).output, HasSubstr("triangles"));

  EXPECT_EQ(
      daemon_.command({"fetch", job, "-o", folder_ / "a.drc", "-o", folder_ / "a.stl"}).status, 0);
  EXPECT_TRUE(read_file(folder_ / "a.drc").starts_with("DRACO"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "a.stl"));

  EXPECT_THAT(daemon_.command({"list"}).output, HasSubstr(job));
  EXPECT_THAT(daemon_.command({"list", "--state", "failed"}).output, testing::Not(HasSubstr(job)));
  EXPECT_THAT(daemon_.command({"list", "--volumes"}).output, HasSubstr(volume));
}

TEST_F(CommandTest, JsonIsTheServersOwn) {
  const Finished uploaded = daemon_.command(raw({"--json", "upload", folder_ / "sphere.raw"}));
  const Volume volume = volume_from_json(uploaded.output);
  EXPECT_EQ(volume_from_json(daemon_.command({"--json", "info", volume.id}).output), volume);
  const Job submitted =
      job_from_json(daemon_.command({"--json", "submit", volume.id, "--iso", "otsu"}).output);
  const Job ended = job_from_json(daemon_.command({"--json", "wait", submitted.id}).output);
  EXPECT_EQ(ended.state, JobState::kSucceeded);
  EXPECT_EQ(ended.parameters.iso, std::nullopt);
  EXPECT_EQ(job_from_json(daemon_.command({"--json", "status", ended.id}).output), ended);
  EXPECT_EQ(jobs_from_json(daemon_.command({"--json", "list"}).output), std::vector{ended});
  EXPECT_EQ(volumes_from_json(daemon_.command({"--json", "list", "--volumes"}).output),
            std::vector{volume});
}

TEST_F(CommandTest, CancelStopsARunningJob) {
  const Job job = long_job(daemon_);
  EXPECT_EQ(daemon_.command({"cancel", job.id}).status, 0);
  const Finished wait = daemon_.command({"wait", job.id});
  EXPECT_EQ(wait.status, 1);
  EXPECT_EQ(daemon_.client().job(job.id).state, JobState::kCancelled);
}

TEST_F(CommandTest, WhatTheServerRefusesIsStatus1WithItsReason) {
  const auto refused = [&](const std::vector<std::string>& words, const std::string& reason) {
    const Finished result = daemon_.command(words);
    EXPECT_EQ(result.status, 1) << words[0];
    EXPECT_THAT(result.errors, HasSubstr(reason));
    EXPECT_TRUE(result.output.empty()) << result.output;
  };
  write_file(folder_ / "garbage.nii", "garbage");
  refused({"upload", folder_ / "garbage.nii"}, "NIfTI");
  refused({"mesh", folder_ / "garbage.nii", "--iso", "1", "-o", folder_ / "out.drc"}, "NIfTI");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out.drc"));
  refused({"status", "0123"}, "no job");
  refused({"wait", "0123"}, "no job");
  refused({"cancel", "0123"}, "no job");
  refused({"fetch", "0123", "-o", folder_ / "out.drc"}, "no job");
  refused({"info", "0123"}, "no volume");
  refused({"submit", "0123", "--iso", "1"}, "no volume");
  refused({"submit", upload(), "--iso", "bone"}, "no preset");
  refused({"fetch", submit(), "-o", folder_ / "out.stl"}, "");
}

TEST_F(CommandTest, WrongUsageIsStatus2) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {}, {"fly"}, {"mesh"}, {"submit", "0123", "--iso", "1", "--passes", "1001"}}) {
    EXPECT_EQ(daemon_.command(words).status, 2) << testing::PrintToString(words);
  }
}

TEST_F(CommandTest, ABatchGoesOnWhenOneFails) {
  std::filesystem::create_directory(folder_ / "in");
  std::filesystem::create_directory(folder_ / "out");
  write_file(folder_ / "in/a.raw", sphere_.bytes);
  write_file(folder_ / "in/b.raw", "too short");
  write_file(folder_ / "in/c.raw", sphere_.bytes);
  const Finished result = daemon_.command(
      raw({"mesh", folder_ / "in/a.raw", folder_ / "in/b.raw", folder_ / "in/c.raw", "--iso", "100",
           "-o", folder_ / "out/", "--format", "stl,obj", "--jobs", "2"}));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: b: "));
  EXPECT_THAT(result.errors, HasSubstr("1 of 3 inputs failed"));
  EXPECT_THAT(files_below(folder_.path() / "out"),
              testing::ElementsAre("a.obj", "a.stl", "c.obj", "c.stl"));
}

TEST_F(CommandTest, AnArchiveOfSeveralMakesAMeshOfEachUnderItsName) {
  write_pair(folder_ / "study/x");
  write_pair(folder_ / "study/y");
  const Finished result =
      daemon_.command({"mesh", folder_ / "study", "--iso", "100", "-o", folder_ / "{name}.stl"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "study-x.stl"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "study-y.stl"));
  const Finished empty =
      daemon_.command({"mesh", folder_ / "study", "--iso", "300", "-o", folder_ / "{name}.obj"});
  EXPECT_THAT(empty.errors, HasSubstr("isomesh: study: y.mhd: the surface is empty"));
}

TEST_F(CommandTest, NoMeshOfARunOverwritesAnother) {
  std::filesystem::create_directory(folder_ / "out");
  write_pair(folder_ / "study/a/ct");
  write_pair(folder_ / "study/b/ct");
  const std::string out = folder_ / "out/";
  const Finished result =
      daemon_.command({"mesh", folder_ / "study", "--iso", "100", "-o", out, "--format", "stl"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_THAT(files_below(out), testing::ElementsAre("study-a_ct.stl", "study-b_ct.stl"));

  write_pair(folder_ / "s/x");
  write_pair(folder_ / "s/y");
  write_pair(folder_ / "s-x");
  const Finished twice = daemon_.command(
      {"mesh", folder_ / "s", folder_ / "s-x.mhd", "--iso", "100", "-o", out, "--format", "obj"});
  EXPECT_EQ(twice.status, 1);
  EXPECT_THAT(twice.errors, HasSubstr("isomesh: s: x.mhd: two meshes would be called s-x"));
  EXPECT_THAT(twice.errors, HasSubstr("--member x.mhd"));
  EXPECT_THAT(files_below(out),
              testing::ElementsAre("s-x.obj", "s-y.obj", "study-a_ct.stl", "study-b_ct.stl"));
}

TEST_F(CommandTest, AMemberThatCannotBeMeshedKeepsNoOtherFromIt) {
  std::filesystem::create_directory(folder_ / "out");
  write_pair(folder_ / "s/a/ct");
  write_pair(folder_ / "s/b/ct");
  write_file(folder_ / "s/b/ct.raw", "too short");
  write_pair(folder_ / "s/x");
  write_file(folder_ / "s/f.raw", std::string(sphere_.bytes.size() * 4, '\0'));
  write_file(folder_ / "s/f.mhd",
             "ObjectType = Image\nNDims = 3\nDimSize = 21 20 19\nElementType = MET_FLOAT\n"
             "ElementDataFile = f.raw\n");
  write_pair(folder_ / "s-x");
  const Finished result = daemon_.command({"mesh", folder_ / "s", folder_ / "s-x.mhd", "--labels",
                                           "all", "-o", folder_ / "out/", "--format", "glb"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: b/ct.mhd: "));
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: f.mhd: "));
  EXPECT_THAT(result.errors, HasSubstr("isomesh: s: x.mhd: two meshes would be called s-x"));
  EXPECT_THAT(files_below(folder_ / "out"), testing::ElementsAre("s-ct.glb", "s-x.glb"));
}

TEST_F(CommandTest, ADryRunLeavesNothingBehind) {
  const Finished dry = daemon_.command(
      raw({"mesh", folder_ / "sphere.raw", "--iso", "100", "--dry-run", "--format", "stl"}));
  EXPECT_EQ(dry.status, 0) << dry.errors;
  EXPECT_THAT(dry.output, HasSubstr("triangles"));
  EXPECT_TRUE(daemon_.client().volumes().empty());
  EXPECT_TRUE(daemon_.client().jobs().jobs.empty());
  const std::string kept = upload();
  daemon_.command(raw({"mesh", folder_ / "sphere.raw", "--iso", "100", "--dry-run"}));
  EXPECT_EQ(daemon_.client().volumes().size(), 1U) << "it was there before";
}

TEST_F(CommandTest, ADryRunThatIsRefusedLeavesNothingBehindEither) {
  EXPECT_EQ(
      daemon_.command(raw({"mesh", folder_ / "sphere.raw", "--iso", "bone", "--dry-run"})).status,
      1);
  EXPECT_TRUE(daemon_.client().volumes().empty());
  // Twice the same volume, which one of them stores and both of them need.
  std::filesystem::copy(folder_ / "sphere.raw", folder_ / "again.raw");
  const Finished both =
      daemon_.command(raw({"mesh", folder_ / "sphere.raw", folder_ / "again.raw", "--iso", "100",
                           "--dry-run", "--jobs", "2", "-o", folder_ / "{name}.stl"}));
  EXPECT_EQ(both.status, 0) << both.errors;
  EXPECT_TRUE(daemon_.client().volumes().empty());
}

TEST_F(CommandTest, SaysWhenItsOutputCannotBeWritten) {
  for (const std::string program :
       {ISOMESH " --help", ISOMESH " completion bash", ISOMESHD " config"}) {
    for (const std::string output : {" > /dev/full", " >&-"}) {
      const Finished full = run({"/bin/sh", "-c", program + output});
      EXPECT_EQ(full.status, 1) << program;
      EXPECT_THAT(full.errors, HasSubstr("standard output cannot be written to"));
    }
  }
}

TEST_F(CommandTest, SaysWhenItsOutputIsClosed) {
  const auto sh = [&](const std::string& words) {
    return run({"/bin/sh", "-c", words}, {"ISOMESH_SERVER=" + daemon_.url()});
  };
  const std::string mesh = ISOMESH " mesh " + (folder_ / "sphere.raw").string() +
                           " --dims 21,20,19 --type uint8 --iso 100 -o - --format stl";
  for (const std::string& words : {mesh, std::string(ISOMESH " list")}) {
    const Finished closed = sh(words + " >&-");
    EXPECT_EQ(closed.status, 1) << words;
    EXPECT_THAT(closed.errors, HasSubstr("standard output cannot be written to"));
    EXPECT_EQ(sh(words + " >&- 2>&-").status, 1) << words;
  }
  EXPECT_EQ(sh(ISOMESH " mesh - --dims 21,20,19 --type uint8 --iso 100 -o " +
               (folder_ / "closed.stl").string() + " <&-")
                .status,
            1);
  EXPECT_EQ(sh(mesh + " 2>&- <&-").output, sh(mesh).output);
  EXPECT_EQ(sh(ISOMESH " list").status, 0);
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
  std::filesystem::create_directory(folder_ / "limited");
  const Finished result =
      run({"sh", "-c",
           std::string("ulimit -f 1; ") + ISOMESH + " --server " + daemon_.url() + " mesh '" +
               (folder_ / "sphere.raw").string() + "' --dims 21,20,19 --type uint8 --iso 100 -o '" +
               (folder_ / "limited" / "out.stl").string() + "'"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("out.stl: File too large"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "limited"));
}

TEST_F(CommandTest, EraseTakesVolumesAndTellsOfThoseThatAreNone) {
  const std::string volume = upload();
  const Finished erased = daemon_.command({"erase", "0123", volume});
  EXPECT_EQ(erased.status, 1);
  EXPECT_THAT(erased.errors, HasSubstr("0123: "));
  EXPECT_TRUE(daemon_.client().volumes().empty());
}

TEST_F(CommandTest, ReadsAndWritesPipes) {
  const std::string options = " --dims 21,20,19 --type uint8 --iso 100";
  ASSERT_EQ(daemon_
                .command(raw({"mesh", folder_ / "sphere.raw", "--iso", "100", "-q", "-o",
                              folder_ / "file.stl"}))
                .status,
            0);
  const Finished piped =
      run({"sh", "-c",
           "cat '" + (folder_ / "sphere.raw").string() + "' | " + ISOMESH + " --server " +
               daemon_.url() + " mesh -" + options + " -o - --format stl"});
  EXPECT_EQ(piped.status, 0) << piped.errors;
  EXPECT_EQ(piped.output, read_file(folder_ / "file.stl"));
  EXPECT_EQ(daemon_.client().volumes().back().name, "sphere.raw");

  const Finished uploaded =
      run({"sh", "-c",
           "tr '\\000' '\\001' < '" + (folder_ / "sphere.raw").string() + "' | " + ISOMESH +
               " --server " + daemon_.url() + " upload - --dims 21,20,19 --type uint8"});
  EXPECT_EQ(uploaded.status, 0) << uploaded.errors;
  EXPECT_EQ(daemon_.client().volume(uploaded.line()).name, "stdin");
}

TEST(CommandOnItsOwn, MeshesWithoutAServerAndLeavesNothing) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "tmp");
  const RawUpload sphere = sphere_upload();
  write_file(folder / "sphere.raw", sphere.bytes);
  const std::vector<std::string> words =
      with({ISOMESH, "local", folder / "sphere.raw", "--iso", "100", "-o", folder / "out.stl"},
           sphere.options);
  const std::vector<std::string> environment = {"TMPDIR=" + (folder / "tmp").string(),
                                                "ISOMESH_SERVER=http://127.0.0.1:1",
                                                "ISOMESH_LISTEN=nonsense"};
  const Finished result = run(words, environment);
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_GT(read_file(folder / "out.stl").size(), 1000U);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "tmp"));

  const Finished lost = run(words, {"TMPDIR=/no/such/folder"});
  EXPECT_EQ(lost.status, 1);
  EXPECT_THAT(lost.errors, HasSubstr("TMPDIR=/no/such/folder: No such file"));

  const Finished broken = run(with(words, {"--daemon", "/bin/false"}), environment);
  EXPECT_EQ(broken.status, 3);
  EXPECT_THAT(broken.errors, HasSubstr("/bin/false did not start"));
  EXPECT_TRUE(std::filesystem::is_empty(folder / "tmp"));
}

TEST(CommandOnItsOwn, EndsItsDaemonHoweverItEnds) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "tmp");
  const RawUpload noise = long_upload();
  write_file(folder / "noise.raw", noise.bytes);
  for (const int signal : {SIGINT, SIGKILL}) {
    Process command(with({ISOMESH, "local", folder / "noise.raw", "--iso", "50", "--passes", "1000",
                          "-o", folder / "out.drc"},
                         noise.options),
                    {"TMPDIR=" + (folder / "tmp").string()});
    ASSERT_TRUE(eventually([&] { return children_of(command.pid()).size() == 1; }));
    const pid_t daemon = *children_of(command.pid()).begin();
    ASSERT_TRUE(eventually([&] { return program_of(daemon) == "isomeshd"; }));
    command.send_signal(signal);
    EXPECT_NE(command.wait(), 0);
    EXPECT_TRUE(eventually([&] { return program_of(daemon).empty(); })) << "signal " << signal;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out.drc"));
}

TEST(CommandWithoutServer, IsStatus3) {
  std::string url;
  {
    Daemon gone;
    url = gone.url();
    gone.stop();
  }
  const Finished result = run({ISOMESH, "--server", url, "list"});
  EXPECT_EQ(result.status, 3);
  EXPECT_FALSE(result.errors.empty());
  EXPECT_EQ(run({ISOMESH, "list"}, {"ISOMESH_SERVER=" + url}).status, 3);
  const Finished absent = run({ISOMESH, "--server", "unix:/no/such/socket", "list"});
  EXPECT_EQ(absent.status, 3);
  EXPECT_THAT(absent.errors, HasSubstr("start isomeshd, or use `isomesh local`"));
  EXPECT_EQ(run({ISOMESH, "--server", "nonsense", "list"}).status, 2);
}

}  // namespace
}  // namespace isomesh
