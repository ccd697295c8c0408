// Tests of which jobs, volumes and blobs retention keeps on every engine.
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "base/clock.h"
#include "server/store/believed_clock.h"
#include "server/store/retention.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

class RetentionConformance : public test::EngineTest {
 protected:
  RetentionConformance() {
    for (const std::string owner : {"", "other"}) volumes().erase(owner, kVolume);
  }

  Blob put(const std::string& text) { return test::put(blobs(), text); }

  // A volume of so many bytes.
  std::string add_volume(char letter, std::size_t bytes, const std::string& owner = "") {
    Volume volume;
    volume.id = put(std::string(bytes, letter)).key;
    volume.samples = volume.id;
    volume.bytes = bytes;
    volume.created = timestamp();
    volumes().add(owner, volume);
    return volume.id;
  }

  std::string submit(const std::string& volume, double iso, const std::string& owner = "") {
    return job_of(jobs().submit(spec_of(volume, iso, owner))).id;
  }

  static JobSpec spec_of(const std::string& volume, double iso, const std::string& owner = "") {
    JobSpec spec;
    spec.owner = owner;
    spec.parameters.volume = volume;
    spec.parameters.iso = iso;
    return spec;
  }

  // A finished job whose mesh has those bytes.
  std::string finish(const std::string& volume, const std::string& mesh) {
    const std::string id = submit(volume, ++last_iso_);
    EXPECT_TRUE(jobs().finish(claimed(), mesh_of({put(mesh)})));
    return id;
  }

  Retention retention(const RetentionOptions& options) {
    return {jobs(), volumes(), blobs(), scratch_.path(), options};
  }
  Retention retention(std::uint64_t max_bytes, milliseconds keep = std::chrono::hours(1)) {
    RetentionOptions options = young();
    options.keep = keep;
    options.max_bytes = max_bytes;
    options.grace = milliseconds(-2000);
    return retention(options);
  }
  static RetentionOptions young() {
    RetentionOptions options;
    options.grace = milliseconds(100);
    return options;
  }

  bool is_gone(const std::string& id) {
    const auto job = code_thrown_by([&] { jobs().get("", id); });
    const auto volume = code_thrown_by([&] { volumes().get("", id); });
    return job == ErrorCode::kGone && volume == ErrorCode::kGone;
  }
  bool is_job(const std::string& id) {
    return !code_thrown_by([&] { jobs().get("", id); }).has_value();
  }
  std::size_t blob_count() {
    std::size_t count = 0;
    blobs().sweep(Steady::clock::now() + std::chrono::hours(1),
                  [&](const std::string&) { return ++count > 0; });
    return count;
  }

  static std::vector<std::string> ids_of(const std::vector<Expirable>& items) {
    std::vector<std::string> ids;
    for (const Expirable& item : items) ids.push_back(item.id);
    return ids;
  }

  static Time soon() { return std::chrono::system_clock::now() + std::chrono::seconds(1); }

  test::TemporaryFolder scratch_;
  double last_iso_ = 0;
};

INSTANTIATE_TEST_SUITE_P(Engines, RetentionConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(RetentionConformance, KeepsWhatIsYoungAndFits) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, "mesh");
  Retention retention = this->retention(200);
  EXPECT_EQ(retention.named_bytes(), 104U);
  const auto gone = retention.enforce();
  EXPECT_EQ(gone.jobs + gone.volumes + gone.blobs, 0U);
  EXPECT_TRUE(is_job(job));
  EXPECT_EQ(blob_count(), 2U);
}

TEST_P(RetentionConformance, WhatIsTooOldExpiresWithItsFiles) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, "mesh");
  const auto gone = retention(0, milliseconds(-1000)).enforce();
  EXPECT_EQ(gone.jobs, 1U);
  EXPECT_EQ(gone.volumes, 1U);
  EXPECT_EQ(gone.blobs, 2U);
  EXPECT_TRUE(is_gone(job));
  EXPECT_TRUE(is_gone(volume));
  EXPECT_EQ(blob_count(), 0U);
  const auto events = test::events_of(jobs(), "", job, 1);
  ASSERT_EQ(events.size(), 1U) << "somebody may wait for its end";
  EXPECT_EQ(events[0].kind, EventKind::kDone);
}

TEST_P(RetentionConformance, WhatLiveJobsNeedStays) {
  const std::string of_queued = add_volume('q', 100);
  const std::string of_running = add_volume('r', 100);
  const std::string running = submit(of_running, 1);
  const Lease lease = claimed();
  const std::string queued = submit(of_queued, 1);
  retention(1, milliseconds(-1000)).enforce();
  EXPECT_TRUE(is_job(running));
  EXPECT_TRUE(is_job(queued));
  EXPECT_TRUE(volumes().contains("", of_queued));
  EXPECT_TRUE(volumes().contains("", of_running));
  EXPECT_EQ(blob_count(), 2U);
  EXPECT_TRUE(jobs().finish(lease, {}));
}

// The mesh is stored, its worker is about to name it.
TEST_P(RetentionConformance, WhatARunningJobHasStoredStays) {
  const std::string volume = add_volume('v', 100);
  submit(volume, 1);
  const Lease lease = claimed();
  put("mesh");
  EXPECT_EQ(retention(young()).enforce().quarantined, 0U);
  EXPECT_EQ(blob_count(), 2U);
  jobs().finish(lease, {});
  EXPECT_EQ(retention(0).enforce().quarantined, 1U);
}

TEST_P(RetentionConformance, BeyondItsBytesTheOldestGoesFirst) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, std::string(50, '1'));
  const std::string second = finish(volume, std::string(50, '2'));
  const std::string third = finish(volume, std::string(50, '3'));
  const auto gone = retention(220).enforce();
  EXPECT_EQ(gone.jobs, 1U);
  EXPECT_TRUE(is_gone(first));
  EXPECT_TRUE(is_job(second));
  EXPECT_TRUE(is_job(third));
  EXPECT_TRUE(volumes().contains("", volume)) << "it was used after the first job's end";
  EXPECT_EQ(blob_count(), 3U);
}

TEST_P(RetentionConformance, AMeshOfTwoJobsTakesRoomOnce) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, std::string(50, 'm'));
  const std::string second = finish(volume, std::string(50, 'm'));
  EXPECT_EQ(retention(150).enforce().jobs, 0U);
  EXPECT_EQ(retention(149).enforce().jobs, 2U);
  EXPECT_TRUE(is_gone(first));
  EXPECT_TRUE(is_gone(second));
}

TEST_P(RetentionConformance, MakesRoomForAnUploadOrSaysThatThereIsNone) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, std::string(50, 'm'));
  Retention retention = this->retention(200);
  retention.make_room({.bytes = 50});
  EXPECT_TRUE(is_job(job));
  retention.make_room({.bytes = 100});
  EXPECT_TRUE(is_gone(job));
  EXPECT_TRUE(volumes().contains("", volume));
  submit(volume, 1000);
  EXPECT_EQ(code_thrown_by([&] { retention.make_room({.bytes = 101}); }), ErrorCode::kOutOfSpace);
  EXPECT_EQ(code_thrown_by([&] { retention.make_room({.bytes = 1000}); }), ErrorCode::kOutOfSpace);
  EXPECT_TRUE(volumes().contains("", volume));
}

TEST_P(RetentionConformance, OneOwnersVolumeExpiresAloneAndItsSamplesStay) {
  const std::string id = add_volume('v', 100, "other");
  add_volume('v', 100);
  submit(id, 1, "other");
  retention(0, milliseconds(-1000)).enforce();
  EXPECT_EQ(code_thrown_by([&] { volumes().get("", id); }), ErrorCode::kGone);
  EXPECT_TRUE(volumes().contains("other", id));
  EXPECT_EQ(blob_count(), 1U);
}

TEST_P(RetentionConformance, WhatHasExpiredCanComeBack) {
  const std::string volume = add_volume('v', 100);
  retention(0, milliseconds(-1000)).enforce();
  EXPECT_EQ(code_thrown_by([&] { submit(volume, 1); }), ErrorCode::kGone);
  EXPECT_EQ(add_volume('v', 100), volume);
  EXPECT_EQ(jobs().submit(spec_of(volume, 1)).kind, Submission::Kind::kNew);
}

TEST_P(RetentionConformance, ExpiredIdsAreForgottenInTheEnd) {
  const std::string volume = add_volume('v', 100);
  RetentionOptions options;
  options.keep = milliseconds(-1000);
  options.remember = -std::chrono::hours(1);
  retention(options).enforce();
  EXPECT_EQ(code_thrown_by([&] { volumes().get("", volume); }), ErrorCode::kNotFound);
}

TEST_P(RetentionConformance, OldUnfinishedFilesAreSwept) {
  const auto young = scratch_ / "young";
  const auto old = scratch_ / "old";
  test::write_file(young, "1");
  test::write_file(old, "2");
  std::filesystem::last_write_time(
      old, std::filesystem::file_time_type::clock::now() - std::chrono::hours(25));
  retention(0).enforce();
  EXPECT_TRUE(std::filesystem::exists(young));
  EXPECT_FALSE(std::filesystem::exists(old));
}

// Two threads that make room for themselves let no more expire than is needed for both.
TEST_P(RetentionConformance, RoomThatSeveralMakeIsMadeOnce) {
  const std::string volume = add_volume('v', 100);
  for (char letter = 'a'; letter <= 'h'; ++letter) finish(volume, std::string(50, letter));
  Retention retention = this->retention(500);
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&] { retention.make_room({.bytes = 50}); });
  }
  threads.clear();
  EXPECT_EQ(retention.named_bytes(), 450U);
}

TEST_P(RetentionConformance, WhoeverHasMostMakesTheRoom) {
  const std::string others = add_volume('o', 100, "other");  // the oldest
  const std::string first = add_volume('1', 100);
  const std::string second = add_volume('2', 90);
  const std::string third = add_volume('3', 80);
  retention(300).make_room({.bytes = 50});  // of 370 that are there, 120 have to go
  EXPECT_TRUE(volumes().contains("other", others));
  EXPECT_FALSE(volumes().contains("", first));
  EXPECT_FALSE(volumes().contains("", second));
  EXPECT_TRUE(volumes().contains("", third));
  // Now the other one has most, and then nobody has anything.
  retention(300).make_room({.owner = "new", .bytes = 150});
  EXPECT_FALSE(volumes().contains("other", others));
  EXPECT_TRUE(volumes().contains("", third));
  retention(300).make_room({.bytes = 300});
  EXPECT_FALSE(volumes().contains("", third));
}

TEST_P(RetentionConformance, WhatComesCountsAsItsOwners) {
  const std::string others = add_volume('o', 100, "other");  // the oldest
  const std::string first = add_volume('1', 50);
  const std::string second = add_volume('2', 50);
  retention(220).make_room({.bytes = 60});
  EXPECT_TRUE(volumes().contains("other", others));
  EXPECT_FALSE(volumes().contains("", first));
  EXPECT_TRUE(volumes().contains("", second));
  // A file that is written in small pieces is as large as all of them.
  retention(159).make_room({.bytes = 10, .unfinished = 50});
  EXPECT_TRUE(volumes().contains("other", others));
  EXPECT_FALSE(volumes().contains("", second));
  // Its owner has nothing left that may expire.
  retention(159).make_room({.bytes = 150});
  EXPECT_FALSE(volumes().contains("other", others));
}

TEST_P(RetentionConformance, WhatARunningJobNeedsMakesNoRoom) {
  const std::string needed = add_volume('n', 200);
  submit(needed, 1);
  const std::string others = add_volume('o', 50, "other");
  retention(250).make_room({.bytes = 40});
  EXPECT_TRUE(volumes().contains("", needed));
  EXPECT_FALSE(volumes().contains("other", others));
  EXPECT_EQ(code_thrown_by([&] { retention(250).make_room({.bytes = 60}); }),
            ErrorCode::kOutOfSpace);
}

// --- What retention asks of the stores

TEST_P(RetentionConformance, BytesAreToldForEachOwner) {
  const std::string volume = add_volume('v', 100);
  add_volume('v', 100, "other");
  add_volume('w', 10, "other");
  finish(volume, std::string(50, 'm'));
  finish(volume, std::string(50, 'm'));
  EXPECT_EQ(volumes().owned_bytes(), (OwnedBytes{{"", 100}, {"other", 110}}));
  EXPECT_EQ(jobs().owned_bytes(), (OwnedBytes{{"", 50}}));
  EXPECT_THAT(ids_of(volumes().unused({soon(), "other"}, 9)), SizeIs(2));
  EXPECT_THAT(ids_of(volumes().unused({soon(), ""}, 9)), ElementsAre(volume));
  EXPECT_THAT(ids_of(jobs().ended({soon(), "other"}, Ended::kAll, 9)), IsEmpty());
  EXPECT_THAT(ids_of(jobs().ended({soon(), ""}, Ended::kAll, 9)), SizeIs(2));
}

TEST_P(RetentionConformance, EndedJobsAreListedTheOldestFirst) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, "1");
  const std::string bare = submit(volume, 1000);
  jobs().cancel("", bare);
  const std::string third = finish(volume, "3");
  submit(volume, 1001);
  EXPECT_THAT(ids_of(jobs().ended({soon()}, Ended::kAll, 9)), ElementsAre(first, bare, third));
  EXPECT_THAT(ids_of(jobs().ended({soon()}, Ended::kAll, 2)), ElementsAre(first, bare));
  EXPECT_THAT(ids_of(jobs().ended({soon()}, Ended::kWithMesh, 9)), ElementsAre(first, third));
  const Time end_of_second = jobs().ended({soon()}, Ended::kAll, 9).at(1).last_used;
  EXPECT_THAT(ids_of(jobs().ended({end_of_second}, Ended::kAll, 9)), ElementsAre(first));
}

TEST_P(RetentionConformance, JobsExpireUntilEnoughIsFreed) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, std::string(50, 'm'));
  const std::string again = finish(volume, std::string(50, 'm'));
  const std::string third = finish(volume, std::string(50, 'n'));
  EXPECT_EQ(jobs().named_bytes(), 100U);
  const auto items = jobs().ended({soon()}, Ended::kAll, 9);
  const Expired expired = jobs().expire(items, 1);
  EXPECT_THAT(ids_of(expired.records), ElementsAre(first, again));
  EXPECT_EQ(expired.bytes, 50U);
  EXPECT_TRUE(is_gone(first));
  EXPECT_TRUE(is_gone(again));
  EXPECT_TRUE(is_job(third));
  EXPECT_THAT(jobs().expire(items, kAllBytes).records, SizeIs(1))
      << "those that are gone are passed over";
  EXPECT_EQ(jobs().named_bytes(), 0U);
}

TEST_P(RetentionConformance, AVolumeThatIsUsedAgainDoesNotExpire) {
  const std::string used = add_volume('u', 100);
  const std::string needed = add_volume('n', 10);
  const std::string idle = add_volume('i', 1);
  const auto items = volumes().unused({soon()}, 9);
  EXPECT_THAT(ids_of(items), ElementsAre(used, needed, idle));
  add_volume('u', 100);
  submit(needed, 1);
  EXPECT_THAT(ids_of(volumes().unused({soon()}, 9)), ElementsAre(idle, used));
  EXPECT_EQ(volumes().named_bytes(), 111U);
  const Expired expired = volumes().expire(items, kAllBytes);
  EXPECT_THAT(expired.records, SizeIs(1));
  EXPECT_EQ(expired.bytes, 1U);
  EXPECT_TRUE(volumes().contains("", used));
  EXPECT_TRUE(volumes().contains("", needed));
  EXPECT_TRUE(is_gone(idle));
}

TEST_P(RetentionConformance, TheSamplesOfTwoOwnersAreFreedWithTheLast) {
  add_volume('v', 100);
  add_volume('v', 100, "other");
  EXPECT_EQ(volumes().named_bytes(), 100U);
  const Expired expired = volumes().expire(volumes().unused({soon()}, 1), kAllBytes);
  EXPECT_THAT(expired.records, SizeIs(1));
  EXPECT_EQ(expired.bytes, 0U);
  EXPECT_EQ(volumes().expire(volumes().unused({soon()}, 9), kAllBytes).bytes, 100U);
}

TEST_P(RetentionConformance, TheOldestRunIsTheFirstThatWasClaimed) {
  EXPECT_EQ(jobs().oldest_run(), std::nullopt);
  const std::string volume = add_volume('v', 100);
  submit(volume, 1);
  submit(volume, 2);
  const Lease first = claimed();
  const auto began = jobs().oldest_run();
  ASSERT_TRUE(began);
  claimed();
  EXPECT_EQ(jobs().oldest_run(), began);
  jobs().finish(first, {});
  EXPECT_GT(jobs().oldest_run(), began);
}

TEST_P(RetentionConformance, OldEventsAreForgotten) {
  const std::string id = submit(add_volume('v', 100), 1);
  jobs().forget_events(soon() - std::chrono::hours(1));
  EXPECT_THAT(jobs().events("", id, 0, milliseconds(0)), SizeIs(1));
  jobs().forget_events(soon());
  EXPECT_THAT(jobs().events("", id, 0, milliseconds(0)), IsEmpty());
}

// The records know nothing of them: they are more likely wrong than all those files.
TEST_P(RetentionConformance, FilesThatTheRecordsDoNotKnowStay) {
  for (int n = 0; n < 100; ++n) put(std::to_string(n));
  Retention retention = this->retention(0);
  const auto gone = retention.enforce();
  EXPECT_EQ(gone.blobs, 0U);
  EXPECT_GE(gone.left, 80U);
  const auto again = retention.enforce();
  EXPECT_EQ(again.quarantined, 0U) << "somebody has time to look";
  EXPECT_EQ(blob_count() + gone.quarantined, 100U);
}

}  // namespace
}  // namespace isomesh::store
