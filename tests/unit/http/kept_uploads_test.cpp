#include "server/http/requests/kept_uploads.h"

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "proto/error.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::http {
namespace {

using std::chrono::minutes;
using test::eventually;

// One that the test sets.
class SetClock {
 public:
  std::function<KeptUploads::Clock::time_point()> now() {
    return [this] { return KeptUploads::Clock::time_point(passed_.load()); };
  }
  void pass(minutes time, KeptUploads& kept) {
    passed_ = passed_.load() + time;
    kept.wake();
  }

 private:
  std::atomic<KeptUploads::Clock::duration> passed_{};
};

// Stands for an upload: whether it is still kept is all that is looked at.
struct Thing {
  std::shared_ptr<int> body = std::make_shared<int>(0);
  std::weak_ptr<int> seen = body;

  KeptUploads::Kept give() { return {std::exchange(body, nullptr), nullptr}; }
  bool is_there() const { return !seen.expired(); }
};

ErrorCode code_of(KeptUploads& kept, const std::string& owner, const std::string& name) {
  try {
    kept.find(owner, name);
  } catch (const Error& error) {
    return error.code();
  }
  return ErrorCode::kInternal;
}

TEST(KeptUploads, AreFoundByTheirOwnersAlone) {
  KeptUploads kept;
  Thing thing;
  const std::string name = kept.keep("a", thing.give());
  EXPECT_EQ(name.size(), 32U);
  EXPECT_NO_THROW(kept.find("a", name));
  EXPECT_EQ(code_of(kept, "b", name), ErrorCode::kGone);
  EXPECT_EQ(code_of(kept, "a", std::string(32, '0')), ErrorCode::kGone);
  kept.let_go("b", name);
  EXPECT_TRUE(thing.is_there());
  kept.let_go("a", name);
  EXPECT_FALSE(thing.is_there());
  EXPECT_EQ(code_of(kept, "a", name), ErrorCode::kGone);
}

TEST(KeptUploads, GoWhenNobodyAsksForThem) {
  SetClock clock;
  KeptUploads kept({.time = minutes(3)}, {}, clock.now());
  Thing asked_for;
  Thing forgotten;
  const std::string name = kept.keep("a", asked_for.give());
  kept.keep("b", forgotten.give());
  clock.pass(minutes(2), kept);
  kept.find("a", name);
  clock.pass(minutes(1), kept);
  EXPECT_TRUE(eventually([&] { return !forgotten.is_there(); }));
  // All uploads of one round are removed under one lock, so the round is over by now.
  EXPECT_EQ(code_of(kept, "b", name), ErrorCode::kGone);
  EXPECT_TRUE(asked_for.is_there());
  clock.pass(minutes(2), kept);
  EXPECT_TRUE(eventually([&] { return !asked_for.is_there(); }));
}

TEST(KeptUploads, StayWhileTheyAreRead) {
  KeptUploads kept;
  Thing thing;
  const std::string name = kept.keep("a", thing.give());
  KeptUploads::Kept reader = kept.find("a", name);
  kept.let_all_go();
  EXPECT_TRUE(thing.is_there());
  reader.reset();
  EXPECT_FALSE(thing.is_there());
}

TEST(KeptUploads, AreFewForEachOwnerAndInAll) {
  KeptUploads kept({.each = 2, .all = 3});
  std::vector<Thing> things(5);
  const std::string first = kept.keep("a", things[0].give());
  kept.keep("a", things[1].give());
  kept.find("a", first);
  kept.keep("a", things[2].give());
  EXPECT_TRUE(things[0].is_there());
  EXPECT_FALSE(things[1].is_there());
  kept.keep("b", things[3].give());
  kept.keep("c", things[4].give());
  EXPECT_FALSE(things[0].is_there());
  EXPECT_TRUE(things[2].is_there() && things[3].is_there() && things[4].is_there());
}

// Uploads that come in parts.
class KeptParts : public testing::Test {
 protected:
  // One of so many bytes.
  static KeptUploads::Partial begun(KeptUploads& kept, const std::string& owner,
                                    std::size_t bytes = 0) {
    KeptUploads::Partial upload =
        kept.begin({.owner = owner, .query = {}, .upload_name = {"a.nii"}, .sha256 = {}});
    upload->write(*upload->begin_lease(0), std::vector<std::byte>(bytes));
    return upload;
  }

  std::size_t files() const { return test::files_below(folder_.path()).size(); }

  const test::TemporaryFolder folder_;
};

TEST_F(KeptParts, GoWhenNothingMoreComes) {
  SetClock clock;
  KeptUploads kept({.part_time = minutes(3)}, folder_.path(), clock.now());
  begun(kept, "a", 10);
  const KeptUploads::Partial sent = begun(kept, "a", 10);
  clock.pass(minutes(2), kept);
  EXPECT_NO_THROW(kept.find_partial("a", sent->name()));
  EXPECT_EQ(files(), 4U);
  clock.pass(minutes(1), kept);
  EXPECT_TRUE(eventually([&] { return files() == 2; }));
  EXPECT_NO_THROW(kept.find_partial("a", sent->name()));
}

TEST_F(KeptParts, OfWhoHasMostTheLongestIdleGivesWay) {
  KeptUploads kept({.parts = 3}, folder_.path());
  const std::string greedy = begun(kept, "a")->name();
  const std::string second = begun(kept, "a")->name();
  const std::string modest = begun(kept, "b")->name();
  begun(kept, "c");
  EXPECT_THROW(kept.find_partial("a", greedy), Error);
  EXPECT_NO_THROW(kept.find_partial("a", second));
  EXPECT_NO_THROW(kept.find_partial("b", modest));
}

TEST_F(KeptParts, ThoseThatHaveBecomeVolumesTakeNoPlaceOfOthers) {
  KeptUploads kept({.parts = 3}, folder_.path());
  const std::string waiting = begun(kept, "a", 10)->name();
  std::string last;
  for (int n = 0; n < 10; ++n) {
    const KeptUploads::Partial upload = begun(kept, "a", 10);
    upload->complete(*upload->begin_lease(10));
    last = upload->name();
    kept.finish("a", last, "{}", {{"volume", "1"}});
  }
  EXPECT_NO_THROW(kept.find_partial("a", waiting));
  EXPECT_EQ(kept.partial_of("a", last)->note().volume, "{}");
  EXPECT_EQ(kept.partial_of("a", last)->note().read_with, (Parameters{{"volume", "1"}}));
  begun(kept, "a");
  EXPECT_TRUE(eventually([&] { return files() <= 2 * 2 + 4; }));  // theirs are notes alone
}

// The result is the same whether the thread or the next upload makes room first.
TEST_F(KeptParts, OfWhoHasMostBytesTheLongestIdleGivesWay) {
  KeptUploads kept({.part_bytes = 1000}, folder_.path());
  const std::string greedy = begun(kept, "a", 400)->name();
  const std::string second = begun(kept, "a", 100)->name();
  const std::string modest = begun(kept, "b", 300)->name();
  const KeptUploads::Partial sent = begun(kept, "c", 900);
  begun(kept, "c");
  EXPECT_THROW(kept.find_partial("a", greedy), Error);
  EXPECT_THROW(kept.find_partial("b", modest), Error);
  EXPECT_NO_THROW(kept.find_partial("a", second));
  EXPECT_NO_THROW(kept.find_partial("c", sent->name()));
}

TEST_F(KeptParts, CancellingWaitsForWhatReadsThemAndTellsWhatThatStored) {
  KeptUploads kept({}, folder_.path());
  const KeptUploads::Partial upload = begun(kept, "a", 10);
  std::vector<std::string> told;
  std::jthread canceller;
  {
    const PartialUpload::Reading reading(upload);
    const PartialUpload::Reading other(upload);
    canceller = std::jthread([&] { told = kept.cancel("a", upload->name()); });
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any().wait(lock, reading.cancelled(), [] { return false; });
    EXPECT_TRUE(other.cancelled().stop_requested());
    EXPECT_EQ(code_of(kept, "a", upload->name()), ErrorCode::kCancelled);
    EXPECT_EQ(code_of(kept, "b", upload->name()), ErrorCode::kGone);
    EXPECT_THROW(PartialUpload::Reading{upload}, Error);
    // Both were too far to be cancelled.
    reading.stored("one");
    other.stored("two");
    other.stored("one");
  }
  canceller.join();
  EXPECT_EQ(told, (std::vector<std::string>{"one", "two"}));
}

TEST_F(KeptParts, ThatHaveToGoAreNotCancelled) {
  KeptUploads kept({}, folder_.path());
  const KeptUploads::Partial upload = begun(kept, "a", 10);
  const PartialUpload::Reading reading(upload);
  kept.let_go("a", upload->name());
  EXPECT_FALSE(reading.cancelled().stop_requested());
}

TEST_F(KeptParts, AreReadToTheEndWhenTheyHaveToGo) {
  KeptUploads kept({}, folder_.path());
  const std::string name = begun(kept, "a", 10)->name();
  kept.find_partial("a", name)->complete(*kept.find_partial("a", name)->begin_lease(10));
  KeptUploads::Kept reader = kept.find("a", name);
  kept.let_all_go();
  EXPECT_TRUE(std::filesystem::exists(reader->path));
  reader.reset();
  EXPECT_EQ(files(), 0U);
}

}  // namespace
}  // namespace isomesh::http
