// Requests that no honest client sends, and the guards that httplib needs against them. Whatever is
// sent, the daemon answers the next request.
#include <chrono>
#include <deque>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;

class GuardsTest : public testing::Test {
 protected:
  ~GuardsTest() override { EXPECT_EQ(daemon_.get("/livez").status, 200); }

  Answer answer_to(const std::string& bytes) { return test::answer_to(daemon_.url(), bytes); }

  Daemon daemon_;
};

TEST_F(GuardsTest, ABodyWithoutALengthIsRefusedAtOnce) {
  const Connection connection(daemon_.url());
  connection.send("POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\n\r\n");
  // The connection stays open on this side: a server that waited for a body would not answer.
  EXPECT_TRUE(is_problem(connection.receive(), ErrorCode::kLengthRequired));
  for (const std::string path : {"POST /v1/jobs", "POST /v1/mesh?iso=1", "PATCH /v1/volumes/0"}) {
    EXPECT_TRUE(is_problem(answer_to(path + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
                           ErrorCode::kLengthRequired))
        << path;
  }
}

// As `curl -X POST` sends it (RFC 9112, 6.3).
TEST_F(GuardsTest, ARequestThatTakesNoBodyNeedsNoLength) {
  const std::string volume = "/v1/volumes/" + upload(daemon_, sphere_upload()).id;
  const auto post = [&](const std::string& target) {
    return answer_to("POST " + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  };
  EXPECT_EQ(post(volume + "/reoriented?axes=-x,y,z").status, 201);
  EXPECT_TRUE(is_problem(post("/v1/orders/0/retry"), ErrorCode::kNotFound));
  EXPECT_TRUE(is_problem(post("/v1/volumes?upload=" + std::string(32, '0')), ErrorCode::kGone));
  EXPECT_TRUE(is_problem(post("/v1/nothing"), ErrorCode::kNotFound));
  EXPECT_TRUE(is_problem(post("/livez"), ErrorCode::kMethodNotAllowed));
}

TEST_F(GuardsTest, ADeleteNeedsNoBody) {
  const Connection connection(daemon_.url());
  connection.send("DELETE /v1/jobs/0123 HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(is_problem(connection.receive(), ErrorCode::kNotFound));
}

TEST_F(GuardsTest, AnEncodedBodyIsRefused) {
  for (const std::string encoding : {"gzip", "br", "deflate", "gzip, gzip", "unknown"}) {
    for (const std::string path : {"/v1/volumes", "/v1/jobs", "/v1/mesh?iso=1"}) {
      EXPECT_TRUE(
          is_problem(daemon_.send("POST", path, "\x1f\x8b body", {{"Content-Encoding", encoding}}),
                     ErrorCode::kUnsupportedMedia))
          << encoding << ' ' << path;
    }
  }
}

TEST_F(GuardsTest, ALongPathIsRefusedBeforeItIsMatched) {
  for (const std::size_t length : {257U, 4000U, 8000U}) {
    EXPECT_TRUE(is_problem(daemon_.get('/' + std::string(length, 'a')), ErrorCode::kUriTooLong));
  }
  EXPECT_TRUE(
      is_problem(daemon_.get("/v1/jobs?cursor=" + std::string(5000, 'a')), ErrorCode::kUriTooLong));
  EXPECT_TRUE(is_problem(daemon_.get('/' + std::string(100'000, 'a')), ErrorCode::kUriTooLong));
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs/" + std::string(200, 'a')), ErrorCode::kNotFound));
}

TEST_F(GuardsTest, ALongHeaderIsRefused) {
  EXPECT_TRUE(is_problem(daemon_.get("/livez", {{"X-Long", std::string(10'000, 'a')}}),
                         ErrorCode::kHeadersTooLarge));
  EXPECT_EQ(daemon_.get("/livez", {{"X-Long", std::string(4'000, 'a')}}).status, 200);
}

TEST_F(GuardsTest, ManyHeadersAreRefused) {
  Headers headers;
  for (int n = 0; n < 150; ++n) headers.emplace_back("X-" + std::to_string(n), "y");
  EXPECT_TRUE(is_problem(daemon_.get("/livez", headers), ErrorCode::kHeadersTooLarge));
  headers.resize(60);
  EXPECT_EQ(daemon_.get("/livez", headers).status, 200);
}

TEST_F(GuardsTest, OtherMethodsAreNotAllowed) {
  struct Wrong {
    std::string method;
    std::string path;
    std::string allowed;
  };
  for (const Wrong& wrong :
       {Wrong{"DELETE", "/v1/jobs", "GET, HEAD, POST"},
        Wrong{"PUT", "/v1/volumes", "GET, HEAD, POST"},
        Wrong{"POST", "/v1/jobs/0123", "DELETE, GET, HEAD"},
        Wrong{"PUT", "/v1/volumes/0123", "DELETE, GET, HEAD, PATCH"},
        Wrong{"DELETE", "/v1/jobs/0123/mesh.drc", "GET, HEAD"}, Wrong{"GET", "/v1/mesh", "POST"},
        Wrong{"HEAD", "/v1/mesh", "POST"}, Wrong{"OPTIONS", "/v1/jobs", "GET, HEAD, POST"},
        Wrong{"POST", "/livez", "GET, HEAD"}, Wrong{"TRACE", "/livez", "GET, HEAD"},
        Wrong{"CONNECT", "/livez", "GET, HEAD"}, Wrong{"PRI", "/livez", "GET, HEAD"},
        Wrong{"FETCH", "/livez", "GET, HEAD"}}) {
    for (const std::string body : {"", "a body"}) {
      const Answer answer = daemon_.send(wrong.method, wrong.path, body);
      EXPECT_EQ(answer.status, 405) << wrong.method << ' ' << wrong.path;
      EXPECT_EQ(answer.header("allow"), wrong.allowed) << wrong.method << ' ' << wrong.path;
      if (wrong.method != "HEAD") {
        EXPECT_TRUE(is_problem(answer, ErrorCode::kMethodNotAllowed));
      }
    }
  }
}

// The unread body of a refused request must not be taken for the next request.
TEST_F(GuardsTest, ARefusedBodyIsNoRequest) {
  const std::string smuggled = request("GET", "/livez");
  const Connection connection(daemon_.url());
  connection.send(request("POST", "/v1/volumes?flavour=sweet", smuggled));
  const Answer answer = connection.receive();
  EXPECT_EQ(answer.status, 400);
  EXPECT_EQ(answer.body.find("HTTP/1.1"), std::string::npos);
}

TEST_F(GuardsTest, AConnectionIsForOneRequest) {
  const Connection connection(daemon_.url());
  connection.send(request("GET", "/livez") + request("GET", "/readyz"));
  const Answer answer = connection.receive();
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "ok\n");
  EXPECT_EQ(answer.header("connection"), "close");
}

TEST_F(GuardsTest, WhatIsNoHttpIsRefused) {
  for (const std::string& bytes :
       {std::string("\r\n\r\n"), std::string("GET /livez HTTP/9.9\r\n\r\n"),
        std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 15), std::string("G"),
        std::string("GET /livez"), std::string("GET /livez HTTP/1.1\r\nHost: te")}) {
    const Connection connection(daemon_.url());
    connection.send(bytes);
    connection.finish_sending();
    const int status = connection.receive().status;
    EXPECT_TRUE(status == 0 || status == 400) << status << ": " << bytes;
  }
}

TEST_F(GuardsTest, PagesOfOtherOriginsDoNotGetWhatIsHere) {
  for (const std::string path : {"/livez", "/v1/jobs", "/", "/nothing"}) {
    EXPECT_EQ(daemon_.get(path).header("cross-origin-resource-policy"), "same-origin") << path;
  }
  EXPECT_EQ(answer_to("nonsense\r\n\r\n").header("cross-origin-resource-policy"), "same-origin");
}

TEST(AllowHost, HoldsWithTheOpenNetworkToo) {
  const TemporaryFolder folder;
  const Daemon daemon(folder / "data", "0.0.0.0:0",
                      {"--open-network", "--allow-host", "iso.example"});
  const auto status_for = [&](const std::string& host) {
    return test::answer_to(daemon.url(), "GET /livez HTTP/1.1\r\nHost: " + host + "\r\n\r\n")
        .status;
  };
  EXPECT_EQ(status_for("iso.example"), 200);
  EXPECT_EQ(status_for("localhost"), 200);
  EXPECT_EQ(status_for("evil.example"), 403);
}

TEST_F(GuardsTest, ASpoofedAddressDoesNoHarm) {
  EXPECT_EQ(daemon_.get("/livez", {{"REMOTE_ADDR", "1.2.3.4"}, {"REMOTE_PORT", "x"}}).status, 200);
}

// Two readings of where a body ends are how requests are smuggled past a proxy.
TEST_F(GuardsTest, ABodyHasOneLength) {
  for (const std::string headers :
       {"Content-Length: 3\r\nContent-Length: 3", "Content-Length: 3\r\nTransfer-Encoding: chunked",
        "Transfer-Encoding: gzip, chunked", "Transfer-Encoding : chunked", "Content-Length: +3",
        "Content-Length: 18446744073709551616"}) {
    const Answer answer =
        answer_to("POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n\r\nabc");
    EXPECT_TRUE(is_problem(answer, ErrorCode::kInvalidParameter)) << headers;
  }
}

// The library would make line breaks of them, in the log and in answers.
TEST_F(GuardsTest, HeadersAreTakenAsTheyAre) {
  const Job job = finished_job(daemon_);
  const Answer answer = daemon_.get("/v1/jobs/" + job.id + "/events", {{"Last-Event-ID", "%31"}});
  EXPECT_TRUE(blames(answer, "Last-Event-ID"));
}

TEST_F(GuardsTest, ARequestNamesItsHost) {
  EXPECT_TRUE(blames(answer_to("GET /livez HTTP/1.1\r\n\r\n"), "Host"));
  EXPECT_TRUE(blames(answer_to("GET /livez HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n"),
                     "Host"));
  EXPECT_EQ(answer_to("GET /livez HTTP/1.0\r\n\r\n").status, 200);
}

// True if `path` responds before the daemon can give up any of `count` connections that sent
// `bytes`. A later response might only have come because one of them was given up. Opening them can
// take that long on a busy machine; then it tries again with new connections.
bool answers_beside(const Daemon& daemon, const std::string& path, std::deque<Connection>& hanging,
                    std::size_t count, const std::string& bytes) {
  constexpr std::chrono::seconds kFirstGivenUp{10};
  constexpr int kMostTries = 10;
  for (int tries = 0; tries < kMostTries; ++tries) {
    const std::size_t before = hanging.size();
    const auto began = std::chrono::steady_clock::now();
    for (std::size_t n = 0; n < count; ++n) hanging.emplace_back(daemon.url()).send(bytes);
    EXPECT_EQ(daemon.get(path).status, 200);
    if (std::chrono::steady_clock::now() - began < kFirstGivenUp) return true;
    while (hanging.size() > before) hanging.pop_back();
  }
  return false;
}

TEST_F(GuardsTest, WaitersAndReadersDoNotStarveOthers) {
  const Job done = finished_job(daemon_, R"("formats": ["stl"])");
  const Job job = long_job(daemon_);
  const std::string path = "/v1/jobs/" + job.id;
  std::deque<Connection> hanging;
  const auto hang_on = [&](std::size_t count, const std::string& bytes) {
    EXPECT_TRUE(answers_beside(daemon_, path, hanging, count, bytes)) << bytes;
  };
  hang_on(64, request("GET", path + "/events"));
  hang_on(64, request("GET", path + "?wait=30"));
  hang_on(64, request("GET", "/v1/jobs/" + done.id + "/mesh.stl"));
  daemon_.client().cancel(job.id);
}

}  // namespace
}  // namespace isomesh
