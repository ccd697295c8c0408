// Tests of the store of the own worklist on every engine.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "server/hospital/records/workitem_store.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr WorkitemLimits kRoomy = {.most = 100, .most_bytes = 1'000'000};

class WorkitemsConformance : public test::EngineTest {
 protected:
  WorkitemStore store() { return WorkitemStore(database()); }

  WorkitemStore::Added add(const std::string& uid, const WorkitemLimits& limits = kRoomy) {
    return store().add({.uid = uid, .data = R"({"00080018":{}})"}, limits);
  }
  std::vector<std::string> listed(std::optional<WorkitemState> state = {}) {
    std::vector<std::string> uids;
    store().read(state, [&](const WorkitemRecord& record) {
      uids.push_back(record.uid);
      return true;
    });
    return uids;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, WorkitemsConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(WorkitemsConformance, AreKeptAsTheyWereChanged) {
  using Added = WorkitemStore::Added;
  EXPECT_EQ(add("1.2"), Added::kNew);
  EXPECT_EQ(add("1.2"), Added::kExists);
  const auto claim = [](WorkitemRecord& record) {
    record.state = WorkitemState::kInProgress;
    record.transaction = "1.99";
    record.data = R"({"a":"\u0000 \u00e9"})";
  };
  EXPECT_TRUE(store().change("1.2", claim));
  EXPECT_FALSE(store().change("1.3", claim));
  restart();
  const WorkitemRecord changed = {.uid = "1.2",
                                  .state = WorkitemState::kInProgress,
                                  .transaction = "1.99",
                                  .data = R"({"a":"\u0000 \u00e9"})"};
  EXPECT_EQ(store().find("1.2"), changed);
  EXPECT_EQ(store().find("1.3"), std::nullopt);
  EXPECT_THROW(store().change("1.2",
                              [](WorkitemRecord& record) {
                                record.data = "";
                                throw Error(ErrorCode::kNotReady, "no");
                              }),
               Error);
  EXPECT_EQ(store().find("1.2"), changed);
}

TEST_P(WorkitemsConformance, AreListedByAgeAndState) {
  std::vector<std::string> added;
  for (int n = 0; n < 120; ++n) {
    added.push_back("1." + std::to_string(200 - n));
    add(added.back(), {.most = 1000, .most_bytes = 1'000'000});
  }
  EXPECT_EQ(listed(), added);
  store().change(added[100],
                 [](WorkitemRecord& record) { record.state = WorkitemState::kCompleted; });
  EXPECT_THAT(listed(WorkitemState::kCompleted), ElementsAre(added[100]));
  EXPECT_EQ(listed(WorkitemState::kScheduled).size(), added.size() - 1);
}

TEST_P(WorkitemsConformance, AreLimitedAndForgotten) {
  using Added = WorkitemStore::Added;
  EXPECT_EQ(add("1.1", {.most = 1, .most_bytes = 100}), Added::kNew);
  EXPECT_EQ(add("1.2", {.most = 1, .most_bytes = 100}), Added::kFull);
  EXPECT_EQ(add("1.2", {.most = 2, .most_bytes = 20}), Added::kFull);
  EXPECT_EQ(store().forget(now() - std::chrono::hours(1)), 0U);
  EXPECT_EQ(store().forget(now() + std::chrono::hours(1)), 1U);
  EXPECT_THAT(listed(), IsEmpty());
}

}  // namespace
}  // namespace isomesh::store
