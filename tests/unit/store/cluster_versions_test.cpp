// Tests of processes of two versions that share the jobs of one database, as in an upgrade.
#include <optional>
#include <string>

#include "tests/support/errors.h"
#include "tests/unit/store/cluster_fixture.h"

namespace isomesh::store::postgresql {
namespace {

using test::code_thrown_by;
using testing::HasSubstr;
using testing::IsEmpty;

// Node one is old, and so is two.
class ClusterVersionsTest : public ClusterTest {
 protected:
  void SetUp() override {
    ClusterTest::SetUp();
    if (IsSkipped()) return;
    newer_.emplace(url_, "newer", blobs_, of_next_version("newer"));
  }

  static JobStoreOptions of_next_version(const std::string& mesher) {
    return {.mesher_version = mesher, .job_version = 2, .grace = milliseconds(0)};
  }

  // Accepted by the newer node.
  std::string submit_newer() { return job_of(newer().jobs.submit(spec())).id; }
  // Its value is one that the other nodes do not know, and that node does.
  void give_unknown_value(const std::string& id) {
    ask(R"(UPDATE jobs SET record = regexp_replace(regexp_replace(record, '"smoothing":"\w+"',)"
        R"('"smoothing":"newer"'), ', "digest":"\w+"}$', '}') WHERE id = ')" +
        id + "'");
  }
  std::string record_of(const std::string& id) {
    return ask("SELECT record FROM jobs WHERE id = '" + id + "'");
  }

  Node& newer() { return *newer_; }

  std::optional<Node> newer_;
};

TEST_F(ClusterVersionsTest, AnOlderNodeLeavesAJobToANewerOne) {
  const std::string id = submit_newer();
  EXPECT_FALSE(one().can_claim());
  EXPECT_FALSE(one().jobs.claim("worker", kLongLease));
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kQueued) << "it can read this one";
  const std::string older = submit(1);
  EXPECT_EQ(one().claimed().id, older) << "the newer job does not hold up the queue";
  EXPECT_EQ(newer().claimed().id, id);
}

TEST_F(ClusterVersionsTest, AJobThatOnlyANewerNodeCanReadIsNotDamaged) {
  const std::string id = submit_newer();
  give_unknown_value(id);
  ASSERT_THAT(record_of(id), HasSubstr("\"smoothing\":\"newer\""));
  EXPECT_EQ(code_thrown_by([&] { one().jobs.get("", id); }), ErrorCode::kUnavailable);
  EXPECT_THAT(one().jobs.list("", {}, "", 9), IsEmpty());
  EXPECT_EQ(one().jobs.depth("").all_queued(), 1U);
}

TEST_F(ClusterVersionsTest, AnOlderNodeCancelsAJobAndKeepsWhatItCannotRead) {
  const std::string id = submit_newer();
  give_unknown_value(id);
  EXPECT_EQ(one().jobs.cancel("", id).state, JobState::kCancelled);
  EXPECT_EQ(ask("SELECT state FROM jobs"), "4");
  EXPECT_THAT(record_of(id), HasSubstr("\"smoothing\":\"newer\""));
  EXPECT_THAT(record_of(id), HasSubstr("\"state\":\"cancelled\""));
  EXPECT_EQ(code_thrown_by([&] { one().jobs.cancel("", id); }), ErrorCode::kUnavailable);
  EXPECT_THAT(record_of(id), HasSubstr("\"smoothing\":\"newer\"")) << "it had ended";
}

TEST_F(ClusterVersionsTest, AnOlderNodeEndsLostRunsAndKeepsWhatItCannotRead) {
  const std::string id = submit_newer();
  newer().claimed();
  give_unknown_value(id);
  end_leases();
  EXPECT_EQ(one().jobs.reap(), 1U);
  EXPECT_EQ(ask("SELECT state FROM jobs"), "0");
  ask("UPDATE jobs SET record = regexp_replace(record, '\"newer\"', '\"laplacian\"')");
  newer().claimed();
  give_unknown_value(id);
  one().jobs.cancel("", id);
  end_leases();
  EXPECT_EQ(one().jobs.reap(), 1U);
  EXPECT_EQ(ask("SELECT state FROM jobs"), "4");
  EXPECT_THAT(record_of(id), HasSubstr("\"smoothing\":\"newer\""));
}

TEST_F(ClusterVersionsTest, ADamagedRunOfANewerNodeKeepsNoOtherRunning) {
  const std::string damaged = submit_newer();
  newer().claimed();
  ask("UPDATE jobs SET record = '#' || record");
  const std::string id = submit(1);
  newer().claimed();
  end_leases();
  EXPECT_EQ(one().jobs.reap(), 2U);
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kQueued);
  EXPECT_EQ(one().jobs.cancel("", damaged).state, JobState::kCancelled);
}

// The key of the older version has the bytes of that version only.
TEST_F(ClusterVersionsTest, AMeshHasTheKeyOfTheVersionThatMadeIt) {
  const std::string id = submit();
  const Lease lease = newer().claimed();
  EXPECT_EQ(lease.id, id);
  EXPECT_EQ(lease.attempt, 1);
  ASSERT_TRUE(newer().jobs.finish(lease, mesh()));
  EXPECT_FALSE(job_of(one().jobs.submit(spec())).reused);
  EXPECT_TRUE(job_of(newer().jobs.submit(spec())).reused);
}

TEST_F(ClusterVersionsTest, ADamagedJobOfAnOlderNodeFailsAtANewerOne) {
  const std::string id = submit();
  ask("UPDATE jobs SET record = '{}'");
  EXPECT_FALSE(newer().jobs.claim("worker", kLongLease));
  EXPECT_EQ(newer().jobs.get("", id).state, JobState::kFailed);
}

TEST_F(ClusterVersionsTest, ADamagedVolumeOfAnOlderJobHoldsUpNoOther) {
  const std::string id = submit();
  ask("UPDATE volumes SET record = '#'");
  EXPECT_EQ(newer().claimed().id, id) << "its run finds out what its volume is";
}

// Its mesh is the same, but not all that was asked for.
TEST_F(ClusterVersionsTest, ANewerJobDoesNotEndWithAnOlderOneLikeIt) {
  newer_.emplace(url_, "newer", blobs_, of_next_version("test"));
  const std::string older = submit();
  const Lease lease = one().claimed();
  const std::string id = submit_newer();
  ASSERT_EQ(ask("SELECT count(DISTINCT result_key) FROM jobs"), "1");
  ASSERT_TRUE(one().jobs.finish(lease, mesh()));
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kQueued);
  EXPECT_EQ(newer().claimed().id, id);
}

}  // namespace
}  // namespace isomesh::store::postgresql
