// Data folders that go away under a running daemon: renamed, replaced, mounted read-only.
#include <string>
#include <vector>

#include "tests/api/problems.h"
#include "tests/faults/fixture.h"
#include "tests/faults/small_disk.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

bool becomes_ready(const Daemon& daemon) {
  return eventually([&] { return daemon.get("/readyz").status == 200; });
}

Answer post_volume(const Daemon& daemon) {
  const RawUpload raw = sphere_upload();
  return daemon.send("POST", "/v1/volumes?" + raw.query, raw.bytes);
}

Answer begin_parts(const Daemon& daemon) {
  const RawUpload raw = sphere_upload();
  return daemon.send("POST", "/v1/volumes?" + raw.query, raw.bytes.substr(0, 100),
                     {{"Upload-Complete", "?0"}});
}

Answer send_part(const Daemon& daemon, const std::string& place, const std::string& part) {
  return daemon.send("PATCH", place, part,
                     {{"Content-Type", "application/partial-upload"},
                      {"Upload-Complete", "?0"},
                      {"Upload-Offset", "100"}});
}

bool asks_to_come_again(const Answer& answer) {
  return is_problem(answer, ErrorCode::kUnavailable) && !answer.header("retry-after").empty();
}

// Each use of the folder by a client.
void expect_all_to_wait(const Daemon& daemon, const std::string& mesh, const std::string& parts) {
  EXPECT_TRUE(asks_to_come_again(daemon.get("/readyz")));
  EXPECT_TRUE(asks_to_come_again(post_volume(daemon)));
  EXPECT_TRUE(asks_to_come_again(begin_parts(daemon)));
  EXPECT_TRUE(asks_to_come_again(send_part(daemon, parts, "abc")));
  EXPECT_TRUE(asks_to_come_again(daemon.get(mesh)));
}

class Away : public FaultTest {
 protected:
  std::filesystem::path place() const { return folder_ / "data"; }
  std::filesystem::path elsewhere() const { return folder_ / "elsewhere"; }
};

TEST_F(Away, AFolderThatComesBackHasLostNothing) {
  start({"--workers", "1"});
  const Job made = finished_job(daemon());
  const std::string path = made.mesh->files.at(MeshFormat::kDrc).href;
  const std::string mesh = mesh_of(made);
  const std::string parts = begin_parts(daemon()).header("location");
  std::filesystem::rename(place(), elsewhere());
  expect_all_to_wait(daemon(), path, parts);
  EXPECT_EQ(daemon().get("/v1/volumes/" + made.parameters.volume).status, 200);
  const std::string id = submit(daemon(), daemon().client().volumes().front(), 60).id;
  EXPECT_EQ(job(id).state, JobState::kQueued);
  EXPECT_FALSE(std::filesystem::exists(place()));
  std::filesystem::rename(elsewhere(), place());
  EXPECT_TRUE(becomes_ready(daemon()));
  EXPECT_EQ(mesh_of(made), mesh);
  EXPECT_EQ(daemon().client().jobs().jobs.size(), 2U) << "no mesh was made again";
  EXPECT_EQ(ended(id).state, JobState::kSucceeded);
  EXPECT_THAT(daemon().errors(), Not(HasSubstr(id + ", attempt"))) << "it was not tried in vain";
  const std::string late_mesh = mesh_of(job(id));
  EXPECT_EQ(send_part(daemon(), parts, "abc").status, 204);
  EXPECT_EQ(post_volume(daemon()).status, 200);
  EXPECT_EQ(daemon().stop(), 0);
  start();
  EXPECT_EQ(mesh_of(job(id)), late_mesh);
  EXPECT_EQ(run_sql("PRAGMA integrity_check"), "ok");
}

// Names of files apart from those that every data folder has.
std::vector<std::string> contents_of(const std::filesystem::path& data) {
  std::vector<std::string> names;
  for (const auto* folder : {"blobs", "quarantine", "scratch", "uploads", "erasing"}) {
    if (!std::filesystem::exists(data / folder)) continue;
    for (const std::string& name : files_below(data / folder)) {
      if (name != "identity") names.push_back(std::string(folder) + '/' + name);
    }
  }
  return names;
}

TEST_F(Away, AnotherDaemonInItsPlaceReceivesNothingOfIt) {
  start({"--workers", "1"});
  const Job made = finished_job(daemon());
  const std::string path = made.mesh->files.at(MeshFormat::kDrc).href;
  const std::string parts = begin_parts(daemon()).header("location");
  const Job running = long_job(daemon());
  std::filesystem::rename(place(), elsewhere());
  const std::size_t records = daemon().client().volumes().size();
  {
    Daemon second(place(), "127.0.0.1:0");
    ASSERT_TRUE(becomes_ready(second));
    expect_all_to_wait(daemon(), path, parts);
    EXPECT_EQ(daemon().send("DELETE", parts).status, 204);
    EXPECT_EQ(daemon().send("DELETE", "/v1/jobs/" + running.id).status, 200);
    EXPECT_TRUE(comes_to(running.id, JobState::kCancelled));
    EXPECT_THAT(contents_of(place()), testing::IsEmpty());
    EXPECT_TRUE(second.client().volumes().empty());
    const Job other = finished_job(second);
    // The first one ends, with files of its own that have these names.
    EXPECT_EQ(daemon().stop(), 0);
    EXPECT_EQ(second.client().job(other.id), other);
    EXPECT_EQ(upload(second, long_upload()).name, std::nullopt);
    EXPECT_EQ(second.stop(), 0);
  }
  EXPECT_EQ(run_sql("PRAGMA integrity_check"), "ok");
  {
    const Daemon again(place(), "127.0.0.1:0");
    EXPECT_EQ(again.client().volumes().size(), 2U);
  }
  std::filesystem::remove_all(place());
  std::filesystem::rename(elsewhere(), place());
  start();
  EXPECT_EQ(daemon().client().volumes().size(), records);
  EXPECT_EQ(daemon().get(path).status, 200);
}

class AwayOnADisk : public testing::Test {
 protected:
  void SetUp() override {
    if (!disk_.is_mounted()) {
      GTEST_SKIP() << "NOT TESTED: this needs a file system of its own, and the system does not "
                      "let this user make namespaces";
    }
    // A mount of its own, so that another can be put in its place.
    run_there(R"(mkdir "$0/disk" "$0/data" && mount --bind "$0/disk" "$0/data")");
    daemon_.emplace(disk_.inside() / "data", "127.0.0.1:0",
                    std::vector<std::string>{"--workers", "1"}, disk_.prefix());
  }

  // In the daemon's namespace, with the folder of the disk as $0.
  void run_there(const std::string& script) const {
    std::vector<std::string> command = disk_.prefix();
    command.insert(command.end(), {"sh", "-c", script, disk_.inside()});
    const Finished finished = run(command);
    ASSERT_EQ(finished.status, 0) << finished.errors;
  }

  // All that needs the folder waits from `leave` to `come_back`, and nothing is lost.
  void expect_to_wait(const std::string& leave, const std::string& come_back) const {
    const Daemon& daemon = *daemon_;
    const Job made = finished_job(daemon);
    const std::string path = made.mesh->files.at(MeshFormat::kDrc).href;
    const std::string parts = begin_parts(daemon).header("location");
    run_there(leave);
    expect_all_to_wait(daemon, path, parts);
    const std::string id = submit(daemon, daemon.client().volumes().front(), 60).id;
    EXPECT_EQ(daemon.client().job(id).state, JobState::kQueued);
    run_there(come_back);
    EXPECT_TRUE(becomes_ready(daemon));
    EXPECT_EQ(daemon.client().wait(id).state, JobState::kSucceeded);
    EXPECT_EQ(daemon.get(path).status, 200);
    EXPECT_EQ(send_part(daemon, parts, "abc").status, 204);
    EXPECT_EQ(post_volume(daemon).status, 200);
  }

 private:
  const SmallDisk disk_{std::uint64_t{48} << 20};
  std::optional<Daemon> daemon_;
};

// The daemon could still write through what it has open.
TEST_F(AwayOnADisk, AFolderThatIsMountedReadOnlyTakesNothing) {
  expect_to_wait(R"(mount --bind "$0/disk" "$0/data" && mount -o remount,bind,ro "$0/data")",
                 R"(umount "$0/data")");
}

// Although it is in use.
TEST_F(AwayOnADisk, AFolderThatIsUnmountedForAWhileHasLostNothing) {
  expect_to_wait(R"(umount --lazy "$0/data")", R"(mount --bind "$0/disk" "$0/data")");
}

}  // namespace
}  // namespace isomesh
