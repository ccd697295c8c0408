// Starting and ending a whole server.
#include "server/http/server.h"

#include <chrono>
#include <cstdint>
#include <functional>
#include <latch>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/api/http.h"
#include "tests/unit/http/services.h"

namespace isomesh::http {
namespace {

// Its threads call the listener until it is stopped.
class Orders final : public Wing {
 public:
  bool has_listener() const { return static_cast<bool>(listener_); }

  bool is_open() const override { return true; }
  void add_routes(App& /*app*/) override {}
  std::optional<bool> has_ended(const std::string& /*id*/) const override { return std::nullopt; }
  void on_end(std::function<void(const std::string& id)> listener) override {
    listener_ = std::move(listener);
  }
  void job_ended(const std::string& job) override {
    if (on_job_ended) on_job_ended(job);
  }
  std::vector<MeasuredFamily> measure() const override { return {}; }
  void begin_drain() override {}
  void stop() override { listener_ = {}; }

  std::function<void(const std::string& job)> on_job_ended;

 private:
  std::function<void(const std::string& id)> listener_;
};

TEST(Server, OrdersEndBeforeItIfTheStartFailsLater) {
  OpenServices services;
  Orders orders;
  {
    Server server(services.all(&orders), ServerOptions{});
    server.bind(net::parse_address("127.0.0.1:0"));
    server.start();
    EXPECT_TRUE(orders.has_listener());
  }
  EXPECT_FALSE(orders.has_listener());
}

// Rates need a first sample.
TEST(Server, CountsTheFailuresOfAllRoutesFromTheStart) {
  OpenServices services;
  const Server server(services.all(), ServerOptions{});
  const std::string text = services.all().metrics.text({}, MetricsFormat::kOpenMetrics);
  for (const auto& [method, route] : {std::pair("POST", "/v1/jobs"), std::pair("HEAD", "/livez"),
                                      std::pair("POST", "none"), std::pair("other", "none")}) {
    EXPECT_THAT(text,
                testing::HasSubstr("\nisomesh_http_requests_total{method=\"" + std::string(method) +
                                   "\",route=\"" + route + "\",status=\"5xx\"} 0\n"));
  }
}

std::string add_job(OpenServices& services, double iso = 1) {
  services.volumes().add("", Volume{});
  JobParameters parameters;
  parameters.iso = iso;
  return job_of(services.jobs().submit({"", parameters, "", ""})).id;
}

TEST(Server, JobsThatEndWhileItEndsAreReported) {
  OpenServices services;
  const std::string first = add_job(services, 1);
  const std::string second = add_job(services, 2);
  Orders orders;
  std::vector<std::string> reported;
  std::latch begun{1};
  orders.on_job_ended = [&](const std::string& job) {
    reported.push_back(job);
    if (reported.size() > 1) return;
    begun.count_down();
    services.jobs().is_closed.wait(false);
  };
  Server server(services.all(&orders), ServerOptions{});
  server.bind(net::parse_address("127.0.0.1:0"));
  server.start();
  services.jobs().cancel("", first);
  begun.wait();
  services.jobs().cancel("", second);
  server.stop();
  EXPECT_THAT(reported, testing::ElementsAre(first, second));
}

// A reader that reconnects in that moment would never hear of it otherwise.
TEST(Server, TheEndOfAJobIsToldAlthoughItsEventIsNotThereYet) {
  OpenServices services;
  const std::string id = add_job(services);
  const auto last_id = [&] {
    return services.jobs().events("", id, 0, std::chrono::milliseconds(0)).back().id;
  };
  const std::uint64_t begun = last_id();
  services.jobs().cancel("", id);
  const std::uint64_t ended = last_id();
  Server server(services.all(), ServerOptions{});
  const std::string url = server.bind(net::parse_address("127.0.0.1:0"));
  server.start();
  const auto listen = [&](std::uint64_t last) {
    const test::Connection connection(url);
    connection.send(test::request("GET", "/v1/jobs/" + id + "/events", {},
                                  {{"Last-Event-ID", std::to_string(last)}}));
    return connection.receive();
  };
  for (const bool is_late : {true, false}) {
    services.jobs().is_late = is_late;
    for (const std::uint64_t last : {std::uint64_t{0}, begun}) {
      const test::Answer answer = listen(last);
      EXPECT_EQ(answer.status, 200) << last;
      EXPECT_THAT(answer.body, testing::HasSubstr("event: done")) << last;
    }
  }
  EXPECT_EQ(listen(ended).status, 204);
}

}  // namespace
}  // namespace isomesh::http
