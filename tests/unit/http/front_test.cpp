// The connection layer with handlers of the test's own: who is slow, silent or gone costs the
// others nothing.
#include "server/http/front.h"

#include <chrono>
#include <deque>
#include <future>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/sources.h"
#include "tests/api/http.h"
#include "tests/support/process.h"

namespace isomesh::http {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using test::Answer;
using test::answer_to;
using test::Connection;
using test::request;

// What the daemon promises while others are slow. Sanitizers and busy machines get more.
constexpr auto kPrompt = 50ms;
constexpr auto kPromptEnough = kPrompt * 20;

// Endless words, at once or when the test says so.
class Words : public Source {
 public:
  explicit Words(std::atomic<int>& said) : said_(said) {}

  More next(std::string& bytes) override {
    if (heard_ >= said_) return More::kLater;
    ++heard_;
    bytes += "word\n";
    return More::kBytes;
  }
  bool ends_with_reader() const override { return true; }

 private:
  std::atomic<int>& said_;
  int heard_ = 0;
};

// Many bytes, counted.
class Flood : public Source {
 public:
  explicit Flood(std::atomic<std::size_t>& made) : made_(made) {}

  More next(std::string& bytes) override {
    bytes.assign(64 * 1024, 'x');
    made_ += bytes.size();
    return More::kBytes;
  }

 private:
  std::atomic<std::size_t>& made_;
};

class FrontTest : public testing::Test {
 protected:
  ~FrontTest() override {
    if (front_) front_->close(1s);
  }

  // Few threads, so that whoever holds one is noticed.
  static FrontOptions options() {
    FrontOptions options;
    options.threads = 4;
    return options;
  }

  void open(FrontOptions options) {
    front_.emplace(std::move(options));
    front_->Get("/status",
                [](const auto&, auto& response) { response.set_content("ok", "text/plain"); });
    front_->Get("/words", [this](const auto&, auto& response) {
      set_body(response,
               {std::make_unique<Words>(said_), "text/plain", Framing::kUntilConnectionEnds, 0});
    });
    front_->Get("/flood", [this](const auto&, auto& response) {
      set_body(response, {std::make_unique<Flood>(made_), "text/plain", Framing::kLength,
                          std::uint64_t{1} << 40});
    });
    front_->Get("/wait", [this](const auto&, auto& response) {
      Exchange& exchange = *Exchange::current();
      ++runs_;
      if (!exchange.resumed()) return exchange.park({"job", Clock::now() + wait_});
      response.set_content("waited", "text/plain");
    });
    front_->Get("/block", [this, gate = go_.get_future().share()](const auto&, auto& response) {
      busy_ = true;
      gate.wait();
      response.set_content("done", "text/plain");
    });
    front_->Get("/echo", [](const auto& request, auto& response) {
      response.set_content(request.get_header_value("X-Echo"), "text/plain");
    });
    front_->Post("/body", [](const auto&, auto& response, const auto& read_body) {
      std::size_t size = 0;
      const bool whole = read_body([&](const char*, std::size_t count) {
        size += count;
        return true;
      });
      const bool slow = Exchange::current()->was_too_slow();
      response.set_content((whole  ? "whole "
                            : slow ? "slow "
                                   : "cut ") +
                               std::to_string(size),
                           "text/plain");
    });
    const int port = front_->bind_to_any_port("127.0.0.1");
    url_ = "http://127.0.0.1:" + std::to_string(port);
    front_->open([this](const std::string&) { return ended_.load(); });
  }

  Answer get(const std::string& path) { return answer_to(url_, request("GET", path)); }

  // Connections that have sent that much and nothing more.
  void hang_on(int count, const std::string& bytes) {
    for (int n = 0; n < count; ++n) connections_.emplace_back(url_).send(bytes);
  }

  // How long a status takes, at best: the machine has other things to do.
  Clock::duration time_of_status() {
    Clock::duration best = Clock::duration::max();
    for (int n = 0; n < 5; ++n) {
      const auto began = Clock::now();
      EXPECT_EQ(get("/status").body, "ok");
      best = std::min(best, Clock::now() - began);
    }
    return best;
  }

  std::string url_;
  std::atomic<int> said_ = 0;
  std::atomic<std::size_t> made_ = 0;
  std::atomic<int> runs_ = 0;
  std::atomic<bool> ended_ = false;
  std::atomic<bool> busy_ = false;
  std::promise<void> go_;
  std::chrono::milliseconds wait_ = 60s;
  std::deque<Connection> connections_;
  std::optional<Front> front_;
};

TEST_F(FrontTest, AnswersARequest) {
  open(options());
  const Answer answer = get("/status");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "ok");
  EXPECT_EQ(answer.header("connection"), "close");
}

TEST_F(FrontTest, SilentSlowAndListeningClientsCostTheOthersNothing) {
  open(options());
  hang_on(64, "");
  hang_on(64, "GET /status HTTP/1.1\r\nX-Slow: ");
  hang_on(64, "POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000\r\n\r\nslow");
  hang_on(64, request("GET", "/words"));
  hang_on(64, request("GET", "/wait"));
  EXPECT_LT(time_of_status(), kPrompt * 2);
  said_ = 1;
  front_->something_happened();
  EXPECT_LT(time_of_status(), kPrompt * 2);
}

// Each takes what its socket holds, and then no more.
TEST_F(FrontTest, ReadersThatDoNotReadHoldNoThread) {
  open(options());
  hang_on(16, request("GET", "/flood"));
  ASSERT_TRUE(test::eventually([&] { return made_ > 16U * 64 * 1024; }));
  EXPECT_LT(time_of_status(), kPromptEnough);
}

TEST_F(FrontTest, WhoeverIsSilentForTooLongIsClosed) {
  FrontOptions quick = options();
  quick.doorman.head_time = 100ms;
  open(quick);
  const Connection silent(url_);
  EXPECT_EQ(silent.receive().status, 0);
  const Connection slow(url_);
  slow.send("GET /status HTTP/1.1\r\n");
  EXPECT_EQ(slow.receive().status, 408);
  const Connection half(url_);
  half.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\nhalf");
  EXPECT_EQ(half.receive().status, 408);
}

TEST_F(FrontTest, TheOldestSilentOneMakesRoom) {
  FrontOptions few = options();
  few.doorman.most_held = 8;
  open(few);
  const Connection oldest(url_);
  hang_on(8, "GET /sta");
  EXPECT_EQ(oldest.receive().status, 0);
  EXPECT_EQ(get("/status").status, 200);
}

TEST_F(FrontTest, ManyHalfBodiesAreBounded) {
  FrontOptions little = options();
  little.doorman.most_bytes = 200'000;
  open(little);
  hang_on(10, "POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 60000\r\n\r\n" +
                  std::string(50'000, 'x'));
  EXPECT_EQ(connections_.front().receive().status, 0);
  EXPECT_EQ(get("/status").status, 200);
}

TEST_F(FrontTest, ABodyThatComesTooSlowlyIsGivenUp) {
  FrontOptions quick = options();
  quick.exchange.patience = 100ms;
  open(quick);
  const Connection slow(url_);
  slow.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\nabc");
  EXPECT_EQ(slow.receive().body, "slow 3");
}

TEST_F(FrontTest, ABodyComesInWhateverPieces) {
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
                                test::chunked(std::string(5000, 'y'), 700))
                .body,
            "whole 5000");
}

TEST_F(FrontTest, ABodyIsInvitedOnceItIsWanted) {
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
TEST_F(FrontTest, WhoStillSendsGetsTheAnswer) {
  open(options());
  const Connection connection(url_);
  connection.send(request("POST", "/status", std::string(4'000'000, 'x')));
  EXPECT_EQ(connection.receive().status, 404);
}

TEST_F(FrontTest, WaitersAreAnsweredByTheEndOfTheirJob) {
  open(options());
  hang_on(40, request("GET", "/wait"));
  ASSERT_TRUE(test::eventually([&] { return runs_ == 40; }));
  front_->job_ended("another job");
  EXPECT_LT(time_of_status(), kPromptEnough);
  EXPECT_EQ(runs_, 40);
  // Some of them may not have sat down yet.
  ended_ = true;
  front_->job_ended("job");
  for (const Connection& connection : connections_) EXPECT_EQ(connection.receive().body, "waited");
  EXPECT_EQ(runs_, 80);
}

TEST_F(FrontTest, WaitersAreAnsweredByTheClock) {
  wait_ = 50ms;
  open(options());
  EXPECT_EQ(get("/wait").body, "waited");
  EXPECT_EQ(runs_, 2);
}

TEST_F(FrontTest, AJobThatEndedOnTheWayIsNotWaitedFor) {
  ended_ = true;
  open(options());
  EXPECT_EQ(get("/wait").body, "waited");
}

TEST_F(FrontTest, AStreamGoesOnWhenSomethingHappens) {
  open(options());
  hang_on(2, request("GET", "/words"));
  said_ = 2;
  front_->something_happened();
  for (const Connection& connection : connections_) {
    std::string heard;
    while (!heard.ends_with("word\nword\n")) heard += connection.receive_some();
    EXPECT_THAT(heard, testing::HasSubstr("\r\n\r\nword\nword\n"));
  }
}

TEST_F(FrontTest, AReaderThatIsGoneIsNoticed) {
  open(options());
  hang_on(3, request("GET", "/words"));
  ASSERT_TRUE(test::eventually([&] { return front_->deliveries() == 3; }));
  connections_.clear();
  EXPECT_TRUE(test::eventually([&] { return front_->deliveries() == 0; }));
}

TEST_F(FrontTest, AReaderThatTakesNothingIsGivenUp) {
  FrontOptions quick = options();
  quick.courier.patience = 100ms;
  open(quick);
  hang_on(1, request("GET", "/flood"));
  ASSERT_TRUE(test::eventually([&] { return front_->deliveries() == 1; }));
  EXPECT_TRUE(test::eventually([&] { return front_->deliveries() == 0; }));
}

TEST_F(FrontTest, AFullQueueSaysSo) {
  FrontOptions narrow = options();
  narrow.threads = 1;
  narrow.backlog = 1;
  open(narrow);
  hang_on(1, request("GET", "/block"));
  ASSERT_TRUE(test::eventually([&] { return busy_.load(); }));
  hang_on(1, request("GET", "/status"));  // the one that waits
  ASSERT_TRUE(test::eventually([&] { return front_->held() == 0; }));
  const Answer refused = get("/status");
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.header("retry-after"), "1");
  go_.set_value();
  EXPECT_EQ(connections_[1].receive().body, "ok");
}

TEST_F(FrontTest, HeadersComeAsTheyWereSent) {
  open(options());
  EXPECT_EQ(answer_to(url_, request("GET", "/echo", "", {{"X-Echo", "a%0d%0aX: b"}})).body,
            "a%0d%0aX: b");
}

TEST_F(FrontTest, TheEndCutsBodiesAndAnswersWaiters) {
  open(options());
  const Connection waiting(url_);
  waiting.send(request("GET", "/wait"));
  ASSERT_TRUE(test::eventually([&] { return runs_ == 1; }));
  const Connection sending(url_);
  sending.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\nabc");
  hang_on(3, request("GET", "/words"));
  ASSERT_TRUE(test::eventually([&] { return front_->deliveries() == 3; }));
  const auto began = Clock::now();
  front_->close(10s);
  EXPECT_LT(Clock::now() - began, 5s);
  EXPECT_EQ(waiting.receive().body, "waited");
  EXPECT_EQ(sending.receive().body, "cut 3");
}

}  // namespace
}  // namespace isomesh::http
