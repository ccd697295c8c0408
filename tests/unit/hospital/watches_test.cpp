// Rules that look for new series.
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

class WatchesTest : public OrdersTest {
 protected:
  void watch(const std::vector<std::string>& all_pacs, std::uint32_t days = 2) {
    for (const std::string& pacs : all_pacs) {
      Rule rule;
      rule.name = "of-" + pacs;
      rule.watch = pacs;
      rule.match.days = days;
      rule.parameters = R"({"iso": 100})";
      rule.send = {{.pacs = pacs}};
      settings_.rules.push_back(rule);
    }
    settings_.poll = seconds(1);
    begin();
  }
  std::vector<Order> all() const { return orders_->list(std::nullopt, {}, "", 100); }
};

TEST_F(WatchesTest, OfAPacsThatHangsHoldUpNoOthers) {
  main_->hangs = true;
  watch({"main", "other"});
  ASSERT_TRUE(until([&] { return !all().empty(); }));
  EXPECT_EQ(all().front().rule, "of-other");
}

TEST_F(WatchesTest, OfOnePacsAskItOneAfterAnother) {
  main_->hangs = true;
  watch({"main", "main", "main", "other"});
  ASSERT_TRUE(until([&] { return !all().empty(); }));
  EXPECT_EQ(main_->calls, 1);
  main_->hangs = false;
  EXPECT_TRUE(until([&] { return main_->calls >= 3; }));
}

// The PACS does not tell how many instances it has.
TEST_F(WatchesTest, OrderASeriesOfUnknownLengthOnce) {
  watch({"main"});
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(
      until([&] { return all().size() == 1 && all().front().state == OrderState::kSucceeded; }));
  const int calls = main_->calls;
  ASSERT_TRUE(until([&] { return main_->calls >= calls + 2; }));
  EXPECT_EQ(all().size(), 1U);
}

// The order of such a series is forgotten long before the watch looks for it no more.
TEST_F(WatchesTest, ThatLookFarBackOrderOnce) {
  watch({"main"}, 400);
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return all().front().state == OrderState::kSucceeded; }));
  pass(hours(24 * 200));
  ASSERT_TRUE(until([&] { return all().empty(); }));
  const int calls = main_->calls;
  ASSERT_TRUE(until([&] { return main_->calls >= calls + 2; }));
  EXPECT_TRUE(all().empty());
}

}  // namespace
}  // namespace isomesh::orders
