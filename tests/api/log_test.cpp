// Tests of what the daemon's log contains, and what it must not contain.
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;

class LogTest : public testing::Test {
 protected:
  // The lines of that event, once the daemon has ended. Every line must be an object.
  std::vector<json> lines_of(const std::string& event) {
    if (log_.empty()) {
      EXPECT_EQ(daemon_.stop(), 0);
      log_ = daemon_.errors();
    }
    std::vector<json> found;
    std::istringstream lines(log_);
    for (std::string line; std::getline(lines, line);) {
      const json object = json::parse(line);
      if (object["event"] == event) found.push_back(object);
    }
    return found;
  }

  Daemon daemon_{std::vector<std::string>{"--log-format", "json"}};
  std::string log_;
};

TEST_F(LogTest, EveryRequestIsOneLine) {
  const Answer answer = daemon_.send("POST", "/v1/volumes", "garbage");
  const auto lines = lines_of("request");
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0]["method"], "POST");
  EXPECT_EQ(lines[0]["route"], "/v1/volumes");
  EXPECT_EQ(lines[0]["status"], answer.status);
  EXPECT_EQ(lines[0]["out"], answer.body.size());
  EXPECT_EQ(lines[0]["remote"], "127.0.0.1");
  EXPECT_EQ(lines[0]["id"], answer.header("x-request-id"));
  EXPECT_GT(lines[0]["ms"], 0);
}

// As a daemon that was killed between a deletion and the erasing leaves it. It erases these samples
// itself and takes them for nothing that is to be put into quarantine.
TEST(LogOfAStart, DoesNotTakeDeletedSamplesForFilesOfUnknownOrigin) {
  const TemporaryFolder folder;
  const std::filesystem::path data = folder / "data";
  const std::string key(64, 'a');
  {
    Daemon daemon(data, "127.0.0.1:0");
    EXPECT_EQ(daemon.stop(), 0);
  }
  std::filesystem::create_directories(data / "blobs/aa");
  write_file(data / "blobs/aa" / key, "samples");
  write_file(data / "erasing" / key, "");
  Daemon daemon(data, "127.0.0.1:0");
  EXPECT_TRUE(eventually([&] { return !std::filesystem::exists(data / "erasing" / key); }));
  EXPECT_EQ(daemon.stop(), 0);
  EXPECT_FALSE(std::filesystem::exists(data / "blobs/aa" / key));
  EXPECT_TRUE(std::filesystem::is_empty(data / "quarantine"));
  EXPECT_THAT(daemon.errors(), Not(HasSubstr("quarantine")));
}

TEST_F(LogTest, SoIsEveryJobThatEndsAndEveryVolumeThatIsRefused) {
  const Job job = finished_job(daemon_);
  daemon_.send("POST", "/v1/volumes", "garbage");
  const std::string metrics = daemon_.get("/metrics").body;
  EXPECT_THAT(metrics,
              HasSubstr("isomesh_imports_refused_total{reason=\"unsupported-media\"} 1\n"));
  const auto jobs = lines_of("job");
  ASSERT_EQ(jobs.size(), 1U);
  EXPECT_EQ(jobs[0]["id"], job.id);
  EXPECT_EQ(jobs[0]["state"], "succeeded");
  EXPECT_EQ(jobs[0]["attempts"], 1);
  EXPECT_EQ(jobs[0]["triangles"], job.mesh->triangles);
  EXPECT_GT(jobs[0]["total_ms"], 0);
  const auto refused = lines_of("import_refused");
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0]["reason"], "unsupported-media");
}

TEST_F(LogTest, ATraceGoesOn) {
  const std::string trace = "4bf92f3577b34da6a3ce929d0e0e4736";
  const Answer answer =
      daemon_.get("/livez", {{"traceparent", "00-" + trace + "-00f067aa0ba902b7-01"}});
  EXPECT_THAT(answer.header("x-request-id"), MatchesRegex(trace + "-[0-9a-f]{16}"));
  EXPECT_THAT(daemon_.get("/livez", {{"traceparent", "00-1-2-3"}}).header("x-request-id"),
              MatchesRegex("[0-9a-f]{32}-[0-9a-f]{16}"));
  EXPECT_EQ(lines_of("request")[0]["id"], answer.header("x-request-id"));
}

// Paths and queries may hold what a client should not have put there.
TEST_F(LogTest, HoldsNothingThatAClientWrote) {
  daemon_.get("/v1/jobs/DOE-JOHN-19700101");
  daemon_.get("/DOE-JOHN?DOE-JOHN");
  daemon_.get("/v1/jobs?cursor=DOE-JOHN", {{"User-Agent", "DOE-JOHN"}});
  daemon_.send("POST", "/v1/volumes",
               "--x\r\nContent-Disposition: form-data; name=\"file\"; filename=\"DOE-JOHN.nii\"\r\n"
               "\r\nDOE-JOHN\r\n--x--\r\n",
               {{"Content-Type", "multipart/form-data; boundary=x"}});
  EXPECT_EQ(lines_of("request").size(), 4U);
  EXPECT_THAT(log_, Not(HasSubstr("DOE-JOHN")));
  EXPECT_THAT(log_, HasSubstr("\"route\":\"/v1/jobs/{id}\""));
  EXPECT_THAT(log_, HasSubstr("\"route\":\"none\""));
}

}  // namespace
}  // namespace isomesh
