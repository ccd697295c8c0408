// Who is slow, silent or gone costs the others nothing.
#include <chrono>
#include <string>
#include <string_view>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/http/connections_fixture.h"
#include "tests/unit/net/chunk_framings.h"

namespace isomesh::http::fixture {
namespace {

TEST_F(ConnectionsTest, AnswersARequest) {
  open(options());
  const Answer answer = get("/status");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "ok");
  EXPECT_EQ(answer.header("connection"), "close");
}

// Each takes what its socket holds, and then no more.
TEST_F(ConnectionsTest, ReadersThatDoNotReadHoldNoThread) {
  open(patient_options());
  hang_on(16, request("GET", "/flood"));
  ASSERT_TRUE(eventually([&] { return made_ > 16U * 64 * 1024; }));
  EXPECT_EQ(get("/status").body, "ok");
}

// What they have sent is there when they are accepted.
TEST_F(ConnectionsTest, WhoeverIsSilentForTooLongIsClosed) {
  hang_on(1, "");
  hang_on(1, "GET /status HTTP/1.1\r\n");
  hang_on(1, "POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\nhalf");
  ConnectionOptions quick = options();
  quick.acceptor.head_time = 100ms;
  open(quick);
  EXPECT_EQ(clients_[0].receive().status, 0);
  EXPECT_EQ(clients_[1].receive().status, 408);
  EXPECT_EQ(clients_[2].receive().status, 408);
}

TEST_F(ConnectionsTest, TheOldestSilentOneMakesRoom) {
  ConnectionOptions few = options();
  few.connections = 16;  // of which one address has half
  open(few);
  const Connection oldest(url_);
  hang_on(8, "GET /sta");
  EXPECT_EQ(oldest.receive().status, 0);
  EXPECT_EQ(get("/status").status, 200);
}

TEST_F(ConnectionsTest, ABodyThatComesTooSlowlyIsGivenUp) {
  ConnectionOptions quick = options();
  quick.body.patience = 100ms;
  open(quick);
  const Connection slow(url_);
  slow.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\nabc");
  EXPECT_EQ(slow.receive().body, "slow 3");
}

TEST_F(ConnectionsTest, ABodyComesInWhateverPieces) {
  open(options());
  const std::string whole = request("POST", "/body", std::string(200'000, 'x'));
  for (const std::size_t piece : {whole.size(), std::size_t{7'000}, std::size_t{70'000}}) {
    const Connection connection(url_);
    for (std::size_t at = 0; at < whole.size(); at += piece) {
      connection.send(std::string_view(whole).substr(at, piece));
    }
    EXPECT_EQ(connection.receive().body, "whole 200000");
  }
  EXPECT_EQ(answer_to(url_, request("POST", "/body", "small")).body, "whole 5");
  EXPECT_EQ(answer_to(url_, "POST /body HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n" +
                                chunked(std::string(5000, 'y'), 700))
                .body,
            "whole 5000");
}

// From the connection to the handler, whichever way the request announces its body.
TEST_F(ConnectionsTest, EveryFramingOfChunksIsReadOrRefused) {
  open(options());
  for (const auto& [bytes, data] : net::chunk_framings()) {
    for (const std::string header : {"", "Trailer: X-Checksum\r\nTE: trailers\r\n"}) {
      const Answer answer =
          answer_to(url_, "POST /body HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n" +
                              header + "\r\n" + bytes);
      const std::string expected = data ? "whole " + std::to_string(data->size()) : "malformed";
      EXPECT_THAT(answer.body, testing::StartsWith(expected)) << bytes.substr(0, 80);
    }
  }
}

TEST_F(ConnectionsTest, ChunksAreInvitedAsWell) {
  open(options());
  const Connection connection(url_);
  connection.send(
      "POST /body HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nTransfer-Encoding: "
      "chunked\r\n\r\n");
  EXPECT_EQ(connection.receive_some(), "HTTP/1.1 100 Continue\r\n\r\n");
  connection.send("3\r\nabc\r\n0\r\nX-Checksum: abc\r\n\r\n");
  EXPECT_EQ(connection.receive().body, "whole 3");
}

// A client that closes its direction too early has not sent a whole body.
TEST_F(ConnectionsTest, ChunksWithoutAnEndAreCut) {
  open(options());
  const std::string head = "POST /body HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n";
  for (const std::string bytes : {"", "5\r\nhel", "5\r\nhello\r\n", "0\r\n", "0\r\nA: b\r\n"}) {
    const Connection connection(url_);
    connection.send(head + bytes);
    connection.finish_sending();
    EXPECT_THAT(connection.receive().body, testing::StartsWith("cut")) << bytes;
  }
}

// The HTTP library would collect it, for as long as it comes.
TEST_F(ConnectionsTest, ALineOfAChunkThatDoesNotEndIsRefused) {
  open(options());
  const std::string head = "POST /body HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n";
  for (const std::string& line : {std::string(10'000, '0'), "5;" + std::string(10'000, 'x'),
                                  "5\r\nhello" + std::string(10'000, ' ')}) {
    const Connection endless(url_);
    endless.send(head + line);
    EXPECT_THAT(endless.receive().body, testing::StartsWith("malformed")) << line.substr(0, 10);
  }
}

TEST_F(ConnectionsTest, ABodyIsInvitedOnceItIsWanted) {
  open(options());
  const Connection connection(url_);
  connection.send(
      "POST /body HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 3\r\n\r\n");
  EXPECT_EQ(connection.receive_some(), "HTTP/1.1 100 Continue\r\n\r\n");
  connection.send("abc");
  EXPECT_EQ(connection.receive().body, "whole 3");
  // Nobody reads this one.
  EXPECT_EQ(answer_to(url_,
                      "GET /status HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\n"
                      "Content-Length: 3\r\n\r\n")
                .body,
            "ok");
}

// A large body that nobody reads must not destroy the answer on its way.
TEST_F(ConnectionsTest, WhoStillSendsGetsTheAnswer) {
  ConnectionOptions patient = options();
  patient.sender.linger = 1h;
  open(patient);
  const Connection connection(url_);
  connection.send(request("POST", "/status", std::string(4'000'000, 'x')));
  EXPECT_EQ(connection.receive().status, 404);
}

TEST_F(ConnectionsTest, WaitersAreAnsweredByTheEndOfTheirJob) {
  open(options());
  hang_on(40, request("GET", "/wait"));
  ASSERT_TRUE(eventually([&] { return runs_ == 40; }));
  connections_->job_ended("another job");
  EXPECT_EQ(get("/status").body, "ok");
  EXPECT_EQ(resumed_, 0);
  // Some of them may not be parked yet: those find that the job has ended.
  ended_ = true;
  connections_->job_ended("job");
  for (const Connection& connection : clients_) EXPECT_EQ(connection.receive().body, "waited");
  EXPECT_EQ(resumed_, 40);
}

TEST_F(ConnectionsTest, WaitersAreAnsweredByTheClock) {
  wait_ = 50ms;
  open(options());
  EXPECT_EQ(get("/wait").body, "waited");
  EXPECT_EQ(runs_, 1);
  EXPECT_EQ(resumed_, 1);
}

TEST_F(ConnectionsTest, AJobThatEndedOnTheWayIsNotWaitedFor) {
  ended_ = true;
  open(options());
  EXPECT_EQ(get("/wait").body, "waited");
}

TEST_F(ConnectionsTest, AStreamGoesOnWhenSomethingHappens) {
  open(options());
  hang_on(2, request("GET", "/words"));
  said_ = 2;
  connections_->wake_sources();
  for (const Connection& connection : clients_) {
    std::string heard;
    while (!heard.ends_with("word\nword\n")) heard += connection.receive_some();
    EXPECT_THAT(heard, testing::HasSubstr("\r\n\r\nword\nword\n"));
  }
}

TEST_F(ConnectionsTest, AReaderThatIsGoneIsNoticed) {
  open(options());
  hang_on(3, request("GET", "/words"));
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 3; }));
  clients_.clear();
  EXPECT_TRUE(eventually([&] { return connections_->sending() == 0; }));
}

TEST_F(ConnectionsTest, AReaderThatTakesNothingIsGivenUp) {
  ConnectionOptions quick = options();
  quick.sender.patience = 100ms;
  open(quick);
  hang_on(1, request("GET", "/flood"));
  ASSERT_TRUE(eventually([&] { return made_ > 0; }));
  EXPECT_TRUE(eventually([&] { return connections_->sending() == 0; }));
}

TEST_F(ConnectionsTest, AFullQueueSaysSo) {
  ConnectionOptions narrow = options();
  narrow.threads = 1;
  narrow.backlog = 1;
  open(narrow);
  hang_on(1, request("GET", "/block"));
  ASSERT_TRUE(eventually([&] { return busy_.load(); }));
  hang_on(1, request("GET", "/status"));  // the one that waits
  ASSERT_TRUE(eventually([&] { return connections_->pending() == 0; }));
  const Answer refused = get("/status");
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.header("retry-after"), "1");
  go_.set_value();
  EXPECT_EQ(clients_[1].receive().body, "ok");
}

TEST_F(ConnectionsTest, QueriesAreDecoded) {
  open(options());
  EXPECT_EQ(get("/query?b=%41+c&a=?").body, "<a=?><b=A c>");
}

TEST_F(ConnectionsTest, TheEndCutsBodiesAndAnswersWaiters) {
  open(options());
  const Connection waiting(url_);
  waiting.send(request("GET", "/wait"));
  ASSERT_TRUE(eventually([&] { return runs_ == 1; }));
  const Connection sending(url_);
  sending.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\nabc");
  ASSERT_TRUE(eventually([&] { return body_bytes_ == 3; }));
  hang_on(3, request("GET", "/words"));
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 3; }));
  connections_->close(1h);
  EXPECT_EQ(waiting.receive().body, "waited");
  EXPECT_EQ(sending.receive().body, "cut 3");
}

TEST_F(ConnectionsTest, AHandlerThatBeginsToWaitAtTheEndIsAnswered) {
  open(options());
  const Connection late(url_);
  late.send(request("GET", "/block-and-wait"));
  ASSERT_TRUE(eventually([&] { return busy_.load(); }));
  const Connection waiting(url_);
  waiting.send(request("GET", "/wait"));
  ASSERT_TRUE(eventually([&] { return runs_ == 1; }));
  std::jthread closing([&] { connections_->close(1h); });
  EXPECT_EQ(waiting.receive().body, "waited");
  std::this_thread::sleep_for(200ms);  // by then no request gets a thread
  going_.set_value();
  EXPECT_EQ(late.receive().body, "waited");
}

TEST_F(ConnectionsTest, TheEndRefusesRequestsThatHaveNotBegun) {
  ConnectionOptions narrow = patient_options();
  narrow.threads = 3;  // two for one party
  narrow.computing_threads = 2;
  open(narrow);
  const auto hold = [&](const std::string& bytes) {
    hang_on(1, bytes);
    return eventually([&] {
      return connections_->open_connections() == clients_.size() && connections_->pending() == 0;
    });
  };
  ASSERT_TRUE(hold(request("GET", "/compute")) && eventually([&] { return runs_ == 1; }));
  ASSERT_TRUE(hold(request("GET", "/compute")));
  ASSERT_TRUE(hold(request("GET", "/block")) && eventually([&] { return busy_.load(); }));
  ASSERT_TRUE(hold("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\nabc") &&
              eventually([&] { return body_bytes_ == 3; }));
  ASSERT_TRUE(hold(request("POST", "/do", "x")));
  std::jthread closing([&] { connections_->close(1h); });
  EXPECT_EQ(clients_[3].receive().body, "cut 3");
  EXPECT_EQ(clients_[4].receive().status, 503);
  go_.set_value();
  EXPECT_EQ(clients_[2].receive().body, "done");
  computing_.set_value();
  EXPECT_EQ(clients_[0].receive().status, 200);
  EXPECT_EQ(clients_[1].receive().status, 503);
  EXPECT_EQ(runs_, 1);
}

}  // namespace
}  // namespace isomesh::http::fixture
