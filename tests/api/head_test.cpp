// HEAD tells what GET would (RFC 9110, 9.3.2), and headers that choose what GET returns.
#include <map>
#include <set>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/api/openapi.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

class HeadTest : public OpenApiTest {
 protected:
  // The head of the answer. The stream of all jobs ends only for a client that has gone.
  Answer head_of(const std::string& method, const std::string& target, const Headers& headers) {
    const Connection connection(daemon_.url());
    connection.send(request(method, target, {}, headers));
    if (target == "/v1/events") connection.finish_sending();
    Answer answer = connection.receive();
    // Those of one moment and of one request.
    for (const char* name : {"date", "x-request-id"}) answer.headers.erase(name);
    // The counters of metrics grow.
    if (target == "/metrics") {
      const auto length = answer.headers.find("content-length");
      if (length != answer.headers.end()) length->second = "some";
    }
    return answer;
  }

  void expect_same_head(const std::string& target, const Headers& headers) {
    const Answer whole = head_of("GET", target, headers);
    const Answer head = head_of("HEAD", target, headers);
    EXPECT_EQ(head.status, whole.status) << target;
    EXPECT_EQ(head.headers, whole.headers) << target;
    EXPECT_EQ(head.body, "") << target;
  }
};

TEST_F(HeadTest, HasTheHeadersOfGet) {
  ASSERT_TRUE(eventually([&] { return daemon_.get("/readyz").status == 200; }));
  std::set<std::string> targets = {"/index.html", "/v1/jobs/0123", "/v1/jobs?state=x", "/none",
                                   "/v1/jobs/" + job_.id + "/mesh.stl"};
  for (const auto& path : api_.paths()) {
    if (path.second["get"]) targets.insert(example_of(path.first.as<std::string>()));
  }
  EXPECT_GT(targets.size(), 25U);
  for (const std::string& target : targets) {
    for (const Headers& headers :
         {Headers{}, Headers{{"Accept-Encoding", "gzip, br"}}, Headers{{"If-None-Match", "*"}},
          Headers{{"Accept", "text/plain;version=0.0.4"}}}) {
      expect_same_head(target, headers);
    }
  }
}

// One that the server does not read, as no other resource has ranges.
TEST_F(HeadTest, OffersRangesWhereGetHasThem) {
  const std::string mesh = "/v1/jobs/" + job_.id + "/mesh.drc";
  EXPECT_EQ(head_of("HEAD", mesh, {}).header("accept-ranges"), "bytes");
  EXPECT_EQ(daemon_.get(mesh, {{"Range", "bytes=0-3"}}).status, 206);
  for (const std::string target : {"/version", "/livez", "/v1/jobs", "/openapi.yaml"}) {
    EXPECT_EQ(head_of("HEAD", target, {}).header("accept-ranges"), "") << target;
    EXPECT_EQ(daemon_.get(target, {{"Range", "bytes=0-3"}}).status, 200) << target;
  }
}

TEST(MetricsOfADaemon, AreInTheFormatThatTheClientPrefers) {
  const Daemon daemon;
  const std::string open = "application/openmetrics-text; version=1.0.0; charset=utf-8";
  const std::string older = "text/plain; version=0.0.4; charset=utf-8";
  for (const auto& [accept, type] : {std::pair<std::string, std::string>{"", open},
                                     {"text/html", open},
                                     {"text/plain;version=0.0.4", older}}) {
    const Answer metrics =
        daemon.get("/metrics", accept.empty() ? Headers{} : Headers{{"Accept", accept}});
    EXPECT_EQ(metrics.header("content-type"), type) << accept;
    EXPECT_THAT(metrics.header("vary"), HasSubstr("Accept")) << accept;
    EXPECT_EQ(metrics.body.ends_with("# EOF\n"), type == open) << accept;
    EXPECT_EQ(metrics.body.find("# TYPE isomesh_jobs_ended_total counter\n") == std::string::npos,
              type == open)
        << accept;
  }
}

}  // namespace
}  // namespace isomesh
