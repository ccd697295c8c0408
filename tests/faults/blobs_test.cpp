// The real daemon with its files elsewhere: in S3 that fails, and in a folder of their own.

#include "tests/faults/fixture.h"
#include "tests/support/s3_peer.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

class BlobsInS3 : public FaultTest {
 protected:
  void SetUp() override {
    if (const std::string missing = S3Peer::missing(); !missing.empty()) {
      GTEST_SKIP() << missing;
    }
    peer_.emplace();
    write_file(folder_ / "keys", S3Peer::credentials());
  }

  void start_with_peer(const std::vector<std::string>& more = {}) {
    start(with({"--blobs", peer_->url(), "--blob-credentials", folder_ / "keys"}, more));
  }

  int readiness() { return daemon().get("/readyz").status; }

  std::optional<S3Peer> peer_;
};

TEST_F(BlobsInS3, WhatIsStoredOutlivesTheMachine) {
  start_with_peer();
  const Job made = finished_job(daemon());
  const std::string mesh = mesh_of(made);
  kill();
  std::filesystem::remove_all(folder_ / "data/cache");
  start_with_peer();
  EXPECT_TRUE(mesh_of(made) == mesh);
  Volume volume;
  volume.id = made.parameters.volume;
  EXPECT_EQ(ended(submit(daemon(), volume, 60).id).state, JobState::kSucceeded)
      << "the volume is fetched";
  EXPECT_EQ(blob_count(), 0U) << "nothing is in the data folder's own place";
  EXPECT_THAT(daemon().errors(), Not(HasSubstr("not/a+secret")));
}

TEST_F(BlobsInS3, NothingIsLostWhileTheyDoNotAnswer) {
  start_with_peer();
  const Volume volume = small_volume();
  ASSERT_TRUE(eventually([&] { return readiness() == 200; }));
  peer_->fail("drop");
  EXPECT_TRUE(eventually([&] { return readiness() == 503; }));
  const int puts = peer_->count("PUT");
  const std::string id = submit(daemon(), volume, 60).id;
  ASSERT_TRUE(eventually([&] { return peer_->count("PUT") >= puts + 4; }))
      << "it has been tried more often than a job that succeeds stores anything";
  EXPECT_FALSE(is_final(job(id).state));
  peer_->recover();
  EXPECT_EQ(ended(id).state, JobState::kSucceeded);
  EXPECT_FALSE(mesh_of(job(id)).empty());
  EXPECT_TRUE(eventually([&] { return readiness() == 200; }));
}

TEST_F(BlobsInS3, ADownloadThatPrefersItIsSentThere) {
  start_with_peer({"--blob-redirect"});
  const Job made = finished_job(daemon());
  const MeshFile& file = made.mesh->files.at(MeshFormat::kDrc);
  const Answer answer = daemon().get(file.href, {{"Prefer", "redirect"}});
  ASSERT_EQ(answer.status, 307);
  EXPECT_THAT(answer.header("location"),
              HasSubstr(peer_->endpoint() + "/bucket/blobs/" + file.sha256));
  EXPECT_THAT(answer.header("cache-control"), HasSubstr("no-store"));
  EXPECT_EQ(daemon().get(file.href).status, 200) << "who does not know that is not sent away";
  EXPECT_EQ(daemon().send("HEAD", file.href, {}, {{"Prefer", "redirect"}}).status, 200);
}

class BlobsInAFolder : public FaultTest {
 protected:
  BlobsInAFolder() { std::filesystem::create_directory(folder_ / "shared"); }

  void start_there() { start({"--blobs", folder_ / "shared"}); }
};

TEST_F(BlobsInAFolder, AreApartFromTheDatabase) {
  start_there();
  const Job made = finished_job(daemon());
  const std::string mesh = mesh_of(made);
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_EQ(blobs_below(folder_ / "shared").size(), 2U);
  EXPECT_TRUE(eventually([&] { return files_below(folder_ / "shared/holds").empty(); }));
  kill();
  start_there();
  EXPECT_TRUE(mesh_of(made) == mesh);
  EXPECT_TRUE(eventually([&] { return daemon().get("/readyz").status == 200; }));
  std::filesystem::rename(folder_ / "shared", folder_ / "away");
  EXPECT_TRUE(eventually([&] { return daemon().get("/readyz").status == 503; }));
  std::filesystem::rename(folder_ / "away", folder_ / "shared");
  EXPECT_TRUE(eventually([&] { return daemon().get("/readyz").status == 200; }));
}

// A database goes nowhere without its files, and no folder is made for them.
TEST_F(BlobsInAFolder, AnEmptyOrMissingFolderIsRefused) {
  start_there();
  finished_job(daemon());
  kill();
  start_there();  // the mark of the first start alone may not have come to its place
  kill();
  std::filesystem::rename(folder_ / "shared", folder_ / "away");
  EXPECT_THROW(start_there(), std::runtime_error);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "shared"));
  std::filesystem::create_directory(folder_ / "shared");
  EXPECT_THROW(start_there(), std::runtime_error);
}

}  // namespace
}  // namespace isomesh
