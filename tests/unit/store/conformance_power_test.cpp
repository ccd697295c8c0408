// Tests of what every engine has written to disk when it returns, and what it may lose.
#include <string>

#include <gtest/gtest.h>

#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

class PowerConformance : public test::EngineTest {
 protected:
  PowerConformance() { make({.may_lose_power = true}); }
};

INSTANTIATE_TEST_SUITE_P(Engines, PowerConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(PowerConformance, WhatIsAcceptedStays) {
  const std::string key = put_blob("volume");
  add_volume("", key);
  const Job first = submit();
  const JobSpec spec = {"", parameters(), "key", "digest"};
  const Job second = job_of(jobs().submit(spec));
  lose_power();
  EXPECT_EQ(test::get(blobs(), key), "volume");
  EXPECT_TRUE(volumes().names(key));
  EXPECT_EQ(jobs().get("", first.id), first);
  EXPECT_EQ(jobs().submit(spec).kind, Submission::Kind::kExisting);
  EXPECT_EQ(jobs().get("", second.id), second);
}

TEST_P(PowerConformance, WhatHasSucceededHasItsBytes) {
  const std::string id = submit().id;
  jobs().finish(claimed(), mesh_of({{put_blob("mesh"), 4}}));
  const Job job = jobs().get("", id);
  ASSERT_EQ(job.state, JobState::kSucceeded);
  lose_power();
  EXPECT_EQ(jobs().get("", id), job);
  EXPECT_EQ(test::get(blobs(), job.mesh->files.at(MeshFormat::kDrc).sha256), "mesh");
}

TEST_P(PowerConformance, EveryOtherEndStays) {
  const std::string failed = submit().id;
  jobs().finish(claimed(), failure());
  const std::string cancelled = submit().id;
  jobs().cancel("", cancelled);
  const std::string stopped = submit().id;
  claimed();
  jobs().cancel("", stopped);
  lose_power();
  EXPECT_EQ(jobs().get("", failed).state, JobState::kFailed);
  EXPECT_EQ(jobs().get("", cancelled).state, JobState::kCancelled);
  EXPECT_EQ(jobs().get("", stopped).state, JobState::kCancelled);
}

// A claim need not wait for the disk: nobody is left who holds it.
TEST_P(PowerConformance, AClaimThatIsLostIsMadeAgain) {
  const Job job = submit();
  claimed();
  lose_power();
  EXPECT_EQ(jobs().get("", job.id), job);
  const Lease again = claimed();
  EXPECT_EQ(again.attempt, 1);
  EXPECT_TRUE(jobs().finish(again, some_mesh()));
  EXPECT_EQ(jobs().get("", job.id).state, JobState::kSucceeded);
}

TEST_P(PowerConformance, AFailureStaysCounted) {
  const std::string id = submit().id;
  EXPECT_TRUE(jobs().finish(claimed(), failure(true)));
  lose_power();
  EXPECT_EQ(jobs().account(id).attempts, 1);
  EXPECT_EQ(claimed().attempt, 2);
}

}  // namespace
}  // namespace isomesh::store
