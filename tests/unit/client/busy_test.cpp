// Requests to a server that is busy, and when a large upload is given up.
#include "client/isomesh/busy.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::error_of;
using test::FakeServer;
using test::some_volume;
using testing::ElementsAre;
using testing::HasSubstr;

// Pauses pass at once, and their time with them.
class BusyTest : public testing::Test {
 protected:
  Waiting waiting() {
    return {.now = [this] { return now_; },
            .random = [this] { return random_; },
            .pause =
                [this](milliseconds duration, const std::stop_token&) {
                  pauses_.push_back(duration);
                  now_ += duration;
                }};
  }

  PersistentTransport transport(seconds limit) {
    return {{.server = parse_server_address(url_),
             .server_url = url_,
             .token = {},
             .authorities = {},
             .silence_timeout = test::kLongest,
             .stop = {}},
            {.retry_timeout = limit, .waiting = waiting()}};
  }

  // Refuses the first `refusals_` requests with those headers.
  void serve(int status, const httplib::Headers& headers) {
    server_.http.set_pre_routing_handler([=, this](const auto&, httplib::Response& response) {
      if (++requests_ > refusals_) return httplib::Server::HandlerResponse::Unhandled;
      response.status = status;
      response.headers = headers;
      return httplib::Server::HandlerResponse::Handled;
    });
    server_.http.Post("/v1/volumes",
                      [this](const httplib::Request& request, httplib::Response& response) {
                        bodies_.push_back(request.body);
                        response.set_content(to_json(some_volume()), "application/json");
                      });
    server_.http.Get("/v1/volumes", [](const httplib::Request&, httplib::Response& response) {
      response.set_content(to_json(std::vector<Volume>{some_volume()}), "application/json");
    });
    url_ = server_.start();
  }

  // The pauses after that many refusals.
  std::vector<milliseconds> pauses_after(int refusals, seconds retry_after, seconds limit) {
    BusyWait wait(limit, waiting());
    std::vector<milliseconds> pauses;
    for (int n = 0; n < refusals; ++n) {
      const auto pause = wait.next_pause(retry_after);
      if (!pause) break;
      pauses.push_back(*pause);
      now_ += *pause;
    }
    return pauses;
  }

  Waiting::Clock::time_point now_;
  double random_ = 0;
  std::vector<milliseconds> pauses_;
  std::atomic<int> requests_ = 0;
  int refusals_ = 0;
  std::vector<std::string> bodies_;
  std::string url_;
  FakeServer server_;
};

TEST_F(BusyTest, PausesAsTheServerAsksAndAQuarterMoreAtMost) {
  EXPECT_THAT(pauses_after(2, seconds{40}, seconds{100}), ElementsAre(seconds{40}, seconds{40}));
  random_ = 1;
  EXPECT_THAT(pauses_after(1, seconds{40}, seconds{100}), ElementsAre(seconds{50}));
  EXPECT_THAT(pauses_after(1, seconds{1}, seconds{100}), ElementsAre(milliseconds{1500}))
      << "a quarter of a second would spread few clients";
}

TEST_F(BusyTest, PausesEndWithTheTimeLimit) {
  EXPECT_EQ(pauses_after(9, seconds{10}, seconds{35}).size(), 3U);
  EXPECT_THAT(pauses_after(9, seconds{10}, seconds{9}), testing::IsEmpty())
      << "a pause that ends too late is not begun";
  EXPECT_THAT(pauses_after(9, seconds{0}, seconds{0}), testing::IsEmpty());
}

TEST_F(BusyTest, PausesGrowIfTheServerAsksForNone) {
  random_ = 1;
  const auto pauses = pauses_after(20, seconds{0}, seconds{1000});
  ASSERT_EQ(pauses.size(), 20U);
  EXPECT_EQ(pauses[0], milliseconds{500});
  EXPECT_EQ(pauses[1], milliseconds{1000});
  EXPECT_EQ(pauses.back(), seconds{15});
  random_ = 0;
  EXPECT_THAT(pauses_after(1, seconds{0}, seconds{100}), ElementsAre(milliseconds{250}));
}

TEST_F(BusyTest, ARequestIsSentAgainUntilTheServerHasRoom) {
  refusals_ = 12;
  serve(429, {{"Retry-After", "7"}});
  const std::string body = test::pattern(100'000);
  HttpRequest upload{.method = "POST",
                     .target = "/v1/volumes",
                     .headers = {{"Content-Type", "application/octet-stream"}}};
  upload.source = [&](std::uint64_t at, std::span<char> piece) {
    std::ranges::copy(body.substr(at, piece.size()), piece.begin());
  };
  upload.source_bytes = body.size();
  std::vector<milliseconds> excused;
  const HttpResponse response =
      transport(seconds{600}).send(upload, [&](milliseconds pause) { excused.push_back(pause); });
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(requests_, 13);
  EXPECT_EQ(pauses_, std::vector<milliseconds>(12, seconds{7}));
  EXPECT_EQ(excused, pauses_);
  ASSERT_EQ(bodies_.size(), 1U);
  EXPECT_TRUE(bodies_.front() == body);
}

TEST_F(BusyTest, TheResponseIsTheServersOwnIfItStaysBusy) {
  refusals_ = 1'000'000;
  serve(429, {{"Retry-After", "7"}});
  const HttpResponse response = transport(seconds{60}).send({.target = "/v1/volumes"});
  EXPECT_EQ(response.status, 429);
  EXPECT_EQ(response.retry_after, seconds{7});
  EXPECT_EQ(requests_, 9) << "at 0, 7, .. 56 seconds";
}

// The clock of the server is years behind.
TEST_F(BusyTest, ADateCountsFromThatOfTheResponse) {
  refusals_ = 1'000'000;
  serve(503, {{"Date", "Sun, 06 Nov 1994 08:49:37 GMT"},
              {"Retry-After", "Sun, 06 Nov 1994 08:51:07 GMT"}});
  EXPECT_EQ(transport({}).send({.target = "/v1/volumes"}).retry_after, seconds{90});
}

TEST_F(BusyTest, ADateThatHasPassedAndAnyOtherTextAskForNoPause) {
  refusals_ = 1'000'000;
  std::string value = "Sun, 06 Nov 1994 08:49:37 GMT";
  server_.http.set_pre_routing_handler([&](const auto&, httplib::Response& response) {
    response.status = 429;
    response.set_header("Retry-After", value);
    return httplib::Server::HandlerResponse::Handled;
  });
  url_ = server_.start();
  for (const std::string& text : {value, std::string("soon"), std::string("-5")}) {
    value = text;
    EXPECT_EQ(transport({}).send({.target = "/"}).retry_after, seconds{0}) << text;
  }
  value = "99999999999999999999";
  EXPECT_EQ(transport({}).send({.target = "/"}).status, 429);
  value = "9999999999999999999";
  EXPECT_GT(transport({}).send({.target = "/"}).retry_after, seconds{86'400});
}

TEST_F(BusyTest, OtherRefusalsAreNotRepeated) {
  refusals_ = 1'000'000;
  std::atomic<int> status = 0;
  server_.http.set_pre_routing_handler([&](const auto&, httplib::Response& response) {
    ++requests_;
    response.status = status;
    response.set_header("Retry-After", "1");
    return httplib::Server::HandlerResponse::Handled;
  });
  url_ = server_.start();
  for (const int each : {400, 404, 409, 413, 422, 500, 502, 507}) {
    status = each;
    requests_ = 0;
    EXPECT_EQ(transport(seconds{600}).send({.target = "/"}).status, each);
    EXPECT_EQ(requests_, 1) << each;
  }
}

// Each method of a client waits, and the listener hears why.
TEST_F(BusyTest, AClientWaitsAndSaysWhy) {
  refusals_ = 1;
  serve(503, {});
  std::vector<std::string> reasons;
  Client client({.server = url_, .busy = [&](const Error& reason, milliseconds pause) {
                   reasons.emplace_back(reason.what());
                   EXPECT_GT(pause, milliseconds{0});
                 }});
  EXPECT_THAT(client.volumes(), ElementsAre(some_volume()));
  EXPECT_EQ(requests_, 2);
  EXPECT_THAT(reasons, ElementsAre(HasSubstr("503")));
}

// A part that was refused is sent again without a question about what has arrived.
TEST_F(BusyTest, AnUploadInPartsWaits) {
  std::vector<std::string> asked;
  server_.http.set_pre_routing_handler([&](const httplib::Request& request, auto& response) {
    asked.push_back(request.method);
    if (asked.size() == 1) {
      response.status = 201;
      response.set_header("Location", "/v1/uploads/7");
      return httplib::Server::HandlerResponse::Handled;
    }
    if (asked.size() > 2) return httplib::Server::HandlerResponse::Unhandled;
    response.status = 503;
    return httplib::Server::HandlerResponse::Handled;
  });
  server_.http.Patch("/v1/uploads/7", [&](const httplib::Request& request, auto& response) {
    bodies_.push_back(request.body);
    response.status = 201;
    response.set_content(to_json(some_volume()), "application/json");
  });
  const test::TemporaryFolder folder;
  test::write_file(folder / "head.nii", test::pattern(1000));
  Client client({.server = server_.start()});
  EXPECT_EQ(client.upload(folder / "head.nii", {.resumable_bytes = 1}), some_volume());
  EXPECT_THAT(asked, ElementsAre("POST", "PATCH", "PATCH"));
  ASSERT_EQ(bodies_.size(), 1U);
  EXPECT_TRUE(bodies_.front() == test::pattern(1000));
}

TEST_F(BusyTest, AnErrorSaysWhenToComeAgain) {
  refusals_ = 1'000'000;
  serve(429, {{"Retry-After", "7"}});
  Client client({.server = url_, .retry_timeout = {}});
  const Error error = error_of([&] { client.volumes(); });
  EXPECT_EQ(error.code(), ErrorCode::kTooManyRequests);
  EXPECT_EQ(error.retry_after(), seconds{7});
  EXPECT_EQ(error.with_detail("x").with_remedy({}).retry_after(), seconds{7});
  EXPECT_EQ(requests_, 1);
}

TEST_F(BusyTest, AStopRequestEndsThePauseAtOnce) {
  refusals_ = 1'000'000;
  serve(429, {{"Retry-After", "300"}});
  std::stop_source stop;
  std::jthread interrupt;
  Client client(
      {.server = url_,
       .busy = [&](const Error&,
                   milliseconds) { interrupt = std::jthread([&] { stop.request_stop(); }); },
       .stop = stop.get_token()});
  EXPECT_EQ(error_of([&] { client.volumes(); }).code(), ErrorCode::kCancelled);
  EXPECT_EQ(requests_, 1);
}

class PatienceTest : public testing::Test {
 protected:
  void pass(seconds time) { now_ += time; }

  Patience::Clock::time_point now_;
  Patience patience_{[this] { return now_; }};
};

TEST_F(PatienceTest, EndsAMinuteAfterTheFirstFailure) {
  pass(seconds{1000});
  EXPECT_FALSE(patience_.is_over());
  patience_.fail();
  pass(seconds{30});
  patience_.fail();
  patience_.hear(0);
  EXPECT_FALSE(patience_.is_over());
  pass(seconds{30});
  EXPECT_TRUE(patience_.is_over());
}

// Both parts broke, and the second after more than a minute in which it got on.
TEST_F(PatienceTest, BeginsAnewIfTheServerHasMore) {
  patience_.fail();
  patience_.hear(0);
  pass(seconds{90});
  patience_.fail();
  patience_.hear(1'000'000);
  EXPECT_FALSE(patience_.is_over());
  patience_.fail();
  patience_.hear(1'000'000);
  pass(seconds{60});
  EXPECT_TRUE(patience_.is_over());
}

// Two daemons answer in turn, and one has nothing of the upload.
TEST_F(PatienceTest, GoesOnForNothingThatWasReachedBefore) {
  patience_.hear(1'000'000);
  patience_.fail();
  for (int n = 0; n < 6; ++n) {
    pass(seconds{10});
    patience_.hear(n % 2 == 0 ? 0 : 1'000'000);
  }
  EXPECT_TRUE(patience_.is_over());
}

// The server was there, and asked for the time.
TEST_F(PatienceTest, DoesNotCountTheTimeThatABusyServerAskedFor) {
  patience_.excuse(seconds{100});
  patience_.fail();
  pass(seconds{59});
  patience_.excuse(seconds{300});
  pass(seconds{300});
  EXPECT_FALSE(patience_.is_over());
  pass(seconds{1});
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(PatienceTest, PausesGrowUntilTheServerHasMore) {
  const auto first = patience_.next_pause();
  for (int n = 0; n < 20; ++n) patience_.next_pause();
  EXPECT_GT(patience_.next_pause(), first);
  EXPECT_LT(patience_.next_pause(), seconds{10});
  patience_.hear(1);
  EXPECT_EQ(patience_.next_pause(), first);
}

}  // namespace
}  // namespace isomesh
