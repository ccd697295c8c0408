// Clients that take all they can get, and what others have of the daemon meanwhile. The stranger
// has an address of its own, as whoever comes without a token is told apart by that.
#include <deque>
#include <string>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;

constexpr const char* kStranger = "127.0.0.2";

class StrangersTest : public testing::Test {
 protected:
  // Connections of the stranger's that have sent that much.
  void hang_on(int count, const std::string& bytes) {
    for (int n = 0; n < count; ++n) clients_.emplace_back(daemon_.url(), kStranger).send(bytes);
  }

  // The state of the only job.
  JobState state() {
    const auto jobs = daemon_.client().jobs().jobs;
    return jobs.empty() ? JobState::kQueued : jobs.front().state;
  }

  Daemon daemon_{std::vector<std::string>{"--upload-places", "4"}};
  std::deque<Connection> clients_;
};

// Each sends some bytes a second, which is enough to go on.
TEST_F(StrangersTest, SlowUploadsTakeHalfOfThePlaces) {
  const RawUpload sphere = sphere_upload();
  const std::string upload = "/v1/volumes?" + sphere.query;
  const std::string begun = "POST " + upload +
                            " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10000000\r\n\r\n" +
                            std::string(70'000, 'x');
  hang_on(2, begun);
  Answer refused;
  ASSERT_TRUE(eventually([&] {
    hang_on(1, begun);  // one of them may have come while the upload below had the last place
    refused = answer_to(daemon_.url(), request("POST", upload, sphere.bytes), kStranger);
    return refused.status == 429;
  }));
  EXPECT_TRUE(is_problem(refused, ErrorCode::kTooManyRequests));
  EXPECT_FALSE(refused.header("retry-after").empty());
  // Other samples than the stranger's, whose upload may have had the last place.
  std::string mine = sphere.bytes;
  mine.front() = 1;
  EXPECT_EQ(daemon_.send("POST", upload, mine).status, 201);
  clients_.clear();
  EXPECT_TRUE(eventually([&] {
    return answer_to(daemon_.url(), request("POST", upload, sphere.bytes), kStranger).status < 300;
  }));
}

TEST_F(StrangersTest, StreamsOfEventsTakeHalfOfThePlaces) {
  const Job job = long_job(daemon_);
  const std::string follow = request("GET", "/v1/jobs/" + job.id + "/events");
  hang_on(256, follow);
  for (const Connection& stream : clients_) {
    ASSERT_TRUE(stream.receive_some().starts_with("HTTP/1.1 200"));
  }
  const Answer refused = answer_to(daemon_.url(), follow, kStranger);
  EXPECT_TRUE(is_problem(refused, ErrorCode::kTooManyRequests));
  const Connection mine(daemon_.url());
  mine.send(follow);
  EXPECT_TRUE(mine.receive_some().starts_with("HTTP/1.1 200"));
  daemon_.client().cancel(job.id);
}

// Nobody else knows of the job.
TEST_F(StrangersTest, AnAbandonedMeshIsNotMade) {
  const RawUpload much = long_upload();
  const std::string target = "/v1/mesh?iso=50&passes=1000&format=stl&" + much.query;
  hang_on(1, request("POST", target, much.bytes));
  ASSERT_TRUE(eventually([&] { return state() == JobState::kRunning; }));
  clients_.clear();
  EXPECT_TRUE(eventually([&] { return state() == JobState::kCancelled; }));
}

// With the key the client can come back for it.
TEST_F(StrangersTest, AnAbandonedMeshWithAKeyIsMade) {
  const RawUpload much = long_upload();
  const std::string target = "/v1/mesh?iso=50&passes=1000&format=stl&" + much.query;
  hang_on(1, request("POST", target, much.bytes, {{"Idempotency-Key", "again"}}));
  ASSERT_TRUE(eventually([&] { return state() == JobState::kRunning; }));
  clients_.clear();
  const Job job = daemon_.client().jobs().jobs.front();
  EXPECT_FALSE(is_final(daemon_.client().job(job.id, std::chrono::seconds(1)).state));
  daemon_.client().cancel(job.id);
}

}  // namespace
}  // namespace isomesh
