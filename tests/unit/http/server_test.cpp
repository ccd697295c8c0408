// Starting and ending a whole server.
#include "server/http/server.h"

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

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
  void job_ended(const std::string& /*job*/) override {}
  std::vector<MeasuredFamily> measure() const override { return {}; }
  void begin_drain() override {}
  void stop() override { listener_ = {}; }

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

}  // namespace
}  // namespace isomesh::http
