// The real command with many inputs, and what it leaves behind.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

namespace fs = std::filesystem;

class CommandBatchTest : public testing::Test {
 protected:
  // A sphere that differs from those in other places.
  std::string volume(const std::string& name) {
    fs::create_directories((folder_ / name).parent_path());
    std::string bytes = sphere_.bytes;
    bytes.front() = static_cast<char>(++volumes_);
    write_file(folder_ / name, bytes);
    return folder_ / name;
  }

  // `isomesh mesh` of these spheres.
  Finished mesh(const std::vector<std::string>& files, const std::vector<std::string>& more) const {
    std::vector<std::string> words = with({"mesh"}, files);
    const bool has_iso = std::ranges::find(more, "--iso") != more.end();
    if (!has_iso) words = with(words, {"--iso", "100"});
    return daemon_.command(with(with(words, sphere_.options), more));
  }

  std::vector<std::string> outputs() const {
    return fs::exists(folder_ / "out") ? files_below(folder_ / "out") : std::vector<std::string>();
  }

  std::string out(const std::string& name) const { return folder_ / ("out/" + name); }

  const Daemon daemon_;
  const TemporaryFolder folder_;
  const RawUpload sphere_ = sphere_upload();
  int volumes_ = 0;
};

// A client may use half of the daemon's places, which are far fewer.
TEST_F(CommandBatchTest, MoreAtOnceThanTheDaemonTakesAllSucceed) {
  std::vector<std::string> files;
  for (int n = 0; n < 40; ++n) files.push_back(volume("in/" + std::to_string(n) + ".raw"));
  const Finished result = mesh(files, {"--jobs", "32", "-o", out("")});
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.errors, "");
  EXPECT_EQ(outputs().size(), 40U);
}

TEST_F(CommandBatchTest, InputsOfOneNameHaveMeshesOfTheirOwn) {
  const std::vector<std::string> files = {volume("sub-01/anat/T1.raw"),
                                          volume("sub-02/anat/T1.raw")};
  const Finished names = mesh(files, {"-o", out("new/folder/"), "--format", "stl"});
  EXPECT_EQ(names.status, 0) << names.errors;
  EXPECT_THAT(outputs(),
              ElementsAre("new/folder/sub-01_anat_T1.stl", "new/folder/sub-02_anat_T1.stl"));
  const Finished tree = mesh(files, {"-o", out("tree/{folder}/{name}.stl")});
  EXPECT_EQ(tree.status, 0) << tree.errors;
  EXPECT_EQ(read_file(out("tree/sub-01/anat/T1.stl")),
            read_file(out("new/folder/sub-01_anat_T1.stl")));
  EXPECT_TRUE(fs::exists(out("tree/sub-02/anat/T1.stl")));

  const std::size_t before = daemon_.client().volumes().size();
  const Finished clash =
      mesh({volume("a/T1.raw"), volume("a/T2.raw")}, {"-o", out("{folder}.stl")});
  EXPECT_EQ(clash.status, 2);
  EXPECT_THAT(clash.errors, HasSubstr("a/T1.raw and "));
  EXPECT_THAT(clash.errors, HasSubstr("a/T2.raw would both be written to "));
  EXPECT_EQ(daemon_.client().volumes().size(), before) << "nothing was uploaded";
}

TEST_F(CommandBatchTest, SkipsWhatIsDone) {
  std::vector<std::string> files;
  for (const std::string subject : {"1", "2", "3", "4", "5"}) {
    files.push_back(volume("sub-" + subject + "/T1.raw"));
    fs::last_write_time(files.back(), fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  const std::vector<std::string> words = {
      "-o",     out("{folder}/{name}.stl"), "-o", out("{folder}/{name}.glb"), "--jobs", "3",
      "--json", "--skip-existing"};
  const Finished first = mesh(files, words);
  EXPECT_EQ(first.status, 0) << first.errors;
  EXPECT_THAT(first.errors, HasSubstr("skipped 0 of 5 inputs"));
  EXPECT_EQ(outputs().size(), 10U);
  const auto jobs = [&] { return daemon_.client().jobs().jobs.size(); };
  EXPECT_EQ(jobs(), 5U);

  // One mesh is missing, one input was replaced.
  fs::remove(out("sub-2/T1.glb"));
  fs::last_write_time(files[3], fs::file_time_type::clock::now() + std::chrono::hours(1));
  const Finished again = mesh(files, words);
  EXPECT_EQ(again.status, 0) << again.errors;
  EXPECT_THAT(again.errors, HasSubstr("skipped 3 of 5 inputs, whose meshes are newer"));
  EXPECT_EQ(outputs().size(), 10U);
  EXPECT_EQ(jobs(), 7U);
  std::istringstream lines(again.output);
  std::set<std::string> skipped;
  std::set<std::string> made;
  for (std::string line; std::getline(lines, line);) {
    const json told = json::parse(line);
    (told.contains("skipped") ? skipped : made).insert(told.at("input").get<std::string>());
  }
  EXPECT_THAT(skipped, ElementsAre(files[0], files[2], files[4]));
  EXPECT_THAT(made, ElementsAre(files[1], files[3]));
  EXPECT_EQ(mesh({files[0]}, words).status, 0);
  EXPECT_EQ(jobs(), 7U);
}

TEST_F(CommandBatchTest, SkipsTheVolumesOfAFolderThatAreDone) {
  for (const std::string name : {"x", "y"}) {
    fs::create_directories(folder_ / "study");
    volume("study/" + name + ".raw");
    write_file(folder_ / ("study/" + name + ".mhd"),
               "ObjectType = Image\nNDims = 3\nDimSize = 21 20 19\nElementType = MET_UCHAR\n"
               "ElementDataFile = " +
                   name + ".raw\n");
  }
  const std::vector<std::string> words = {"mesh", folder_ / "study", "--iso",          "100",
                                          "-o",   out(""),           "--skip-existing"};
  EXPECT_EQ(daemon_.command(words).status, 0);
  EXPECT_THAT(outputs(), ElementsAre("study-x.drc", "study-y.drc"));
  fs::remove(out("study-y.drc"));
  const Finished again = daemon_.command(words);
  EXPECT_EQ(again.status, 0) << again.errors;
  EXPECT_THAT(again.errors, HasSubstr("study: x.mhd: skipped"));
  EXPECT_THAT(outputs(), ElementsAre("study-x.drc", "study-y.drc"));
  EXPECT_EQ(daemon_.client().jobs().jobs.size(), 3U);
}

TEST_F(CommandBatchTest, EachLineOfJsonSaysItsInput) {
  const std::string good = volume("good.raw");
  const std::string bad = folder_ / "bad.raw";
  write_file(bad, "too short");
  const Finished result = mesh({good, bad}, {"--json", "-o", out("")});
  EXPECT_EQ(result.status, 1);
  std::istringstream lines(result.output);
  std::map<std::string, json> told;
  for (std::string line; std::getline(lines, line);) {
    const json each = json::parse(line);
    told[each.at("input").get<std::string>()] = each;
  }
  ASSERT_EQ(told.size(), 2U) << result.output;
  EXPECT_EQ(told[good]["state"], "succeeded");
  EXPECT_EQ(told[good]["outputs"][0], out("good.drc"));
  EXPECT_GE(told[bad]["error"]["status"], 400);
  EXPECT_THAT(result.errors, HasSubstr(told[bad]["error"]["detail"].get<std::string>()));
}

// So that `make` does not take it for done the second time.
TEST_F(CommandBatchTest, AnEmptySurfaceWritesNothing) {
  const std::string file = volume("sphere.raw");
  const std::string stl = out("sphere.stl");
  const std::vector<std::string> words = {"--iso", "9999", "-o", stl, "-o", out("sphere.glb")};
  fs::create_directory(folder_ / "out");
  for (int round = 0; round < 2; ++round) {
    const Finished empty = mesh({file}, words);
    EXPECT_EQ(empty.status, 1);
    EXPECT_THAT(empty.errors, HasSubstr("the surface is empty"));
    EXPECT_THAT(outputs(), IsEmpty());
  }
  const std::string job = daemon_.client().jobs().jobs.at(0).id;
  EXPECT_EQ(daemon_.command({"fetch", job, "-o", stl}).status, 1);
  EXPECT_THAT(outputs(), IsEmpty());
  EXPECT_EQ(daemon_.command({"fetch", job, "-o", stl, "--allow-empty"}).status, 0);
  EXPECT_EQ(read_file(stl).size(), 84U);
  fs::remove(stl);

  const Finished piped = mesh({file}, {"--iso", "9999", "-o", "-", "--format", "stl"});
  EXPECT_EQ(piped.status, 1);
  EXPECT_EQ(piped.output, "");
  EXPECT_EQ(mesh({file}, with(words, {"--allow-empty"})).status, 0);
  EXPECT_THAT(outputs(), ElementsAre("sphere.glb", "sphere.stl"));
}

// They cannot be replaced by a whole file.
TEST_F(CommandBatchTest, APipeAndTheDeviceOfStandardOutputGetTheMesh) {
  const std::string file = volume("sphere.raw");
  EXPECT_EQ(mesh({file}, {"-o", out(""), "--format", "stl"}).status, 0);
  const std::string whole = read_file(out("sphere.stl"));
  const std::string program = std::string(ISOMESH) + " --server " + daemon_.url() + " mesh '" +
                              file + "' --dims 21,20,19 --type uint8 --iso 100 ";
  const Finished device = run({"bash", "-c", program + "-o /dev/stdout --format stl"});
  EXPECT_EQ(device.status, 0) << device.errors;
  EXPECT_EQ(device.output, whole);

  const std::string fifo = folder_ / "fifo.stl";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  const Finished pipe =
      run({"bash", "-c", "cat '" + fifo + "' & " + program + "-q -o '" + fifo + "' && wait"});
  EXPECT_EQ(pipe.status, 0) << pipe.errors;
  EXPECT_EQ(pipe.output, whole);
  EXPECT_TRUE(fs::is_fifo(fifo));
}

// `isomesh local` cannot remove its folder if it is killed. The next run does.
TEST(CommandLeftovers, OfAKilledRunAreRemovedByTheNext) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "tmp");
  const RawUpload noise = long_upload();
  write_file(folder / "noise.raw", noise.bytes);
  const std::vector<std::string> environment = {"TMPDIR=" + (folder / "tmp").string()};
  const auto local = [&](const std::string& passes) {
    return with({ISOMESH, "local", folder / "noise.raw", "--iso", "50", "--passes", passes, "-o",
                 folder / "out.drc"},
                noise.options);
  };
  {
    Process command(local("1000"), environment);
    ASSERT_TRUE(eventually([&] { return children_of(command.pid()).size() == 1; }));
    const pid_t daemon = *children_of(command.pid()).begin();
    ASSERT_TRUE(eventually([&] { return program_of(daemon) == "isomeshd"; }));
    ASSERT_TRUE(eventually([&] {
      return std::ranges::any_of(files_below(folder / "tmp"), [](const std::string& name) {
        return name.find("/data/") != std::string::npos;
      });
    }));
    command.send_signal(SIGKILL);
    command.wait();
    ASSERT_TRUE(eventually([&] { return program_of(daemon).empty(); }));
  }
  EXPECT_FALSE(fs::is_empty(folder / "tmp"));
  // The processes of the daemon end with it, but not in the same moment.
  EXPECT_TRUE(eventually([&] {
    const Finished next = run(local("0"), environment);
    EXPECT_EQ(next.status, 0) << next.errors;
    return fs::is_empty(folder / "tmp");
  }));
}

}  // namespace
}  // namespace isomesh
