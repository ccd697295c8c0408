// Data folders of other versions, and what expires.
#include <string>

#include "tests/api/problems.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

class Folder : public FaultTest {};

TEST_F(Folder, OfANewerVersionIsRefusedAndLeftAsItIs) {
  start();
  small_volume();
  EXPECT_EQ(daemon().stop(), 0);
  const std::string version = run_sql("PRAGMA user_version");
  run_sql("PRAGMA user_version=99");
  const Finished refused = run({ISOMESHD, "--data", folder_ / "data", "--listen", "127.0.0.1:0"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("newer isomeshd"));
  run_sql("PRAGMA user_version=" + version);
  start();
  EXPECT_EQ(daemon().client().volumes().size(), 1U);
}

TEST_F(Folder, WhatHasExpiredIsGone) {
  start({"--keep-days", "0.00002"});
  const Job job = finished_job(daemon());
  const std::string path = "/v1/jobs/" + job.id;
  ASSERT_TRUE(eventually([&] { return daemon().get(path).status == 410; }));
  EXPECT_TRUE(is_problem(daemon().get(path), ErrorCode::kGone));
  EXPECT_TRUE(is_problem(daemon().get(path + "/mesh.drc"), ErrorCode::kGone));
  const std::string volume = "/v1/volumes/" + job.parameters.volume;
  ASSERT_TRUE(eventually([&] { return daemon().get(volume).status == 410; }));
  EXPECT_TRUE(daemon().client().volumes().empty());
  EXPECT_EQ(finished_job(daemon()).state, JobState::kSucceeded) << "it can be sent again";
}

TEST_F(Folder, AnUploadBeyondTheRoomForAllIsRefused) {
  start({"--max-disk", "5000"});
  const RawUpload raw = sphere_upload();
  EXPECT_TRUE(is_problem(daemon().send("POST", "/v1/volumes?" + raw.query, raw.bytes),
                         ErrorCode::kOutOfSpace));
  EXPECT_EQ(blob_count(), 0U);
}

TEST_F(Folder, TheOldestGoesWhenAllIsTooMuch) {
  start({"--max-disk", "20000"});
  const Volume first = small_volume();
  const RawUpload other = raw_upload(
      sample<std::uint8_t>(scaled(sphere({10.2, 9.7, 9.1}, 5.4), 12, 100), {21, 20, 19}));
  const Volume second = upload(daemon(), other);
  EXPECT_EQ(daemon().get("/v1/volumes/" + first.id).status, 410);
  EXPECT_EQ(daemon().get("/v1/volumes/" + second.id).status, 200);
}

}  // namespace
}  // namespace isomesh
