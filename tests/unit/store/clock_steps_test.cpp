// Tests that data is kept although the system's clock was wrong for a while.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/clock.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/files/blob_store.h"
#include "server/store/retention.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/unit/store/wall_clock.h"

namespace isomesh::store {
namespace {

using std::chrono::days;
using test::ClockSetAhead;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr days kKeep{30};

// One life of the service on a data folder.
class Life {
 public:
  explicit Life(const std::filesystem::path& root, bool trust_clock = false)
      : data_(root),
        database_(data_, {order_tables()}),
        blobs_(data_),
        identity_(database_, blobs_, {.trust_clock = trust_clock}, {}),
        volumes_(database_),
        jobs_(database_, blobs_, {.mesher_version = "test"}),
        orders_(database_) {}

  void store(const std::string& volume) {
    Volume stored;
    stored.id = volume;
    stored.samples = volume;
    stored.created = timestamp();
    volumes_.add("", stored);
  }

  // A job on that volume, which ends at once.
  std::string use(const std::string& volume) {
    JobSpec spec;
    spec.parameters.volume = volume;
    return jobs_.cancel("", job_of(jobs_.submit(spec)).id).id;
  }

  void end_order(const std::string& id) {
    OrderSpec spec;
    spec.record.order.id = id;
    spec.record.order.created = timestamp();
    orders_.submit(spec, 10);
    spec.record.order.state = OrderState::kSucceeded;
    spec.record.order.finished = timestamp();
    orders_.save(spec.record, std::chrono::system_clock::now());
  }
  std::size_t forget_orders() {
    return orders_.forget(identity_.now() - kKeep, identity_.now() - kKeep);
  }

  // Runs one round of housekeeping and returns the ids that are left.
  std::vector<std::string> kept(const std::vector<std::string>& volumes,
                                const std::vector<std::string>& jobs = {}) {
    RetentionOptions options;
    options.keep = kKeep;
    options.now = [this] { return identity_.now(); };
    Retention(jobs_, volumes_, blobs_, data_.scratch(), options).enforce();
    std::vector<std::string> left;
    for (const std::string& id : volumes) {
      if (volumes_.contains("", id)) left.push_back(id);
    }
    for (const std::string& id : jobs) {
      if (!test::code_thrown_by([&] { jobs_.get("", id); })) left.push_back(id);
    }
    return left;
  }

 private:
  DataFolder data_;
  Database database_;
  FileBlobStore blobs_;
  Identity identity_;
  SqlVolumeStore volumes_;
  SqliteJobStore jobs_;
  OrderStore orders_;
};

class ClockSteps : public testing::TestWithParam<int> {
 protected:
  std::filesystem::path root() const { return folder_ / "data"; }

  test::TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(Days, ClockSteps,
                         testing::Values(-4000, -40, -35, -33, -8, -6, 6, 8, 33, 35, 40, 4000),
                         [](const testing::TestParamInfo<int>& step) {
                           return (step.param < 0 ? "Back" : "Ahead") +
                                  std::to_string(std::abs(step.param));
                         });

// Covers existing data, and data made or used while the clock is wrong, with and without
// housekeeping meanwhile.
TEST_P(ClockSteps, WhatIsMadeOrUsedWhileTheClockIsWrongIsKept) {
  for (const bool trust_clock : {false, true}) {
    for (const bool keeps_house : {false, true}) {
      const auto root = folder_ / (std::to_string(trust_clock) + std::to_string(keeps_house));
      Life(root).store("old");
      std::string job;
      {
        const ClockSetAhead wrong{days(GetParam())};
        Life life(root);
        life.store("new");
        job = life.use("old");
        life.end_order("order");
        if (keeps_house) {
          EXPECT_THAT(life.kept({"old", "new"}, {job}), ElementsAre("old", "new", job));
        }
      }
      Life right(root, trust_clock);
      EXPECT_THAT(right.kept({"old", "new"}, {job}), ElementsAre("old", "new", job))
          << trust_clock << keeps_house;
      EXPECT_EQ(right.forget_orders(), 0U);
    }
  }
}

TEST_P(ClockSteps, AStepWhileItRunsTakesNothing) {
  Life life(root());
  life.store("old");
  EXPECT_THAT(life.kept({"old"}), ElementsAre("old"));
  std::string job;
  {
    const ClockSetAhead wrong{days(GetParam())};
    life.store("new");
    job = life.use("old");
    EXPECT_THAT(life.kept({"old", "new"}, {job}), ElementsAre("old", "new", job));
  }
  EXPECT_THAT(life.kept({"old", "new"}, {job}), ElementsAre("old", "new", job));
}

// A machine that has never had the right time until an operator says that this is it.
TEST_P(ClockSteps, WhatIsAsOldAsAWrongClockIsKeptWhenTheRightOneIsTrusted) {
  for (const int later : {0, 7, 5}) {
    const ClockSetAhead wrong{days(GetParam() + later)};
    Life(root(), later > 0).store("by " + std::to_string(later));
  }
  EXPECT_THAT(Life(root(), true).kept({"by 0", "by 7", "by 5"}),
              ElementsAre("by 0", "by 7", "by 5"));
}

TEST(TrustedClock, LetsExpireWhatWasOldBefore) {
  const test::TemporaryFolder folder;
  const auto root = folder / "data";
  {
    const ClockSetAhead wrong(-days(60));
    Life(root).store("old");
  }
  // Each is further ahead by less than is doubted.
  for (const int back : {54, 48, 42}) {
    const ClockSetAhead wrong(-days(back));
    Life(root).kept({});
  }
  {
    const ClockSetAhead wrong(-days(40));
    Life(root).store("young");
  }
  EXPECT_THAT(Life(root).kept({"old", "young"}), ElementsAre("old", "young"));
  EXPECT_THAT(Life(root, true).kept({"old", "young"}), ElementsAre("young"));
}

TEST(UnusedVolumes, ExpireByAClockThatIsRight) {
  const test::TemporaryFolder folder;
  const auto root = folder / "data";
  Life(root).store("old");
  for (const int passed : {6, 12, 18, 24}) {
    const ClockSetAhead later{days(passed)};
    EXPECT_THAT(Life(root).kept({"old"}), ElementsAre("old"));
  }
  const ClockSetAhead later(days(30));
  EXPECT_THAT(Life(root).kept({"old"}), IsEmpty());
}

}  // namespace
}  // namespace isomesh::store
