// Tests of job lists on every engine: their content, and which owner sees what.
#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/clock.h"
#include "tests/support/errors.h"
#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"
#include "tests/unit/store/wall_clock.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;
using testing::ElementsAre;
using testing::IsEmpty;

class JobListConformance : public test::EngineTest {
 protected:
  static std::vector<std::string> ids_of(const std::vector<Job>& jobs) {
    std::vector<std::string> ids;
    for (const Job& job : jobs) ids.push_back(job.id);
    return ids;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, JobListConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

// --- Listing

TEST_P(JobListConformance, ListsTheNewestFirstInPages) {
  std::vector<std::string> ids;
  for (int n = 0; n < 25; ++n) ids.push_back(submit().id);
  const std::vector<std::string> expected(ids.rbegin(), ids.rend());
  EXPECT_EQ(ids_of(jobs().list("", {}, "", 100)), expected);
  std::vector<std::string> paged;
  for (std::string after; paged.size() < expected.size();) {
    const std::vector<std::string> page = ids_of(jobs().list("", {}, after, 10));
    ASSERT_THAT(page, testing::Not(IsEmpty()));
    paged.insert(paged.end(), page.begin(), page.end());
    after = page.back();
  }
  EXPECT_EQ(paged, expected);
  EXPECT_THAT(jobs().list("", {}, expected.back(), 10), IsEmpty());
}

TEST_P(JobListConformance, ListsByState) {
  const std::string cancelled = submit().id;
  jobs().cancel("", cancelled);
  const std::string running = submit().id;
  claimed();
  const std::string queued = submit().id;
  EXPECT_THAT(ids_of(jobs().list("", {.state = JobState::kCancelled}, "", 10)),
              ElementsAre(cancelled));
  EXPECT_THAT(ids_of(jobs().list("", {.state = JobState::kRunning}, "", 10)), ElementsAre(running));
  EXPECT_THAT(ids_of(jobs().list("", {.state = JobState::kQueued}, "", 10)), ElementsAre(queued));
  EXPECT_THAT(jobs().list("", {.state = JobState::kFailed}, "", 10), IsEmpty());
  EXPECT_THAT(ids_of(jobs().list("", {.state = JobState::kQueued, .volume = kVolume}, "", 10)),
              ElementsAre(queued));
  EXPECT_THAT(jobs().list("", {.volume = "another"}, "", 10), IsEmpty());
  const Time submitted = time_of(jobs().get("", queued).created);
  const auto soon = submitted + std::chrono::minutes(1);
  EXPECT_THAT(ids_of(jobs().list("", {.volume = kVolume, .since = submitted}, "", 1)),
              ElementsAre(queued));
  EXPECT_THAT(jobs().list("", {.since = soon}, "", 10), IsEmpty());
  EXPECT_EQ(jobs().list("", {.until = soon}, "", 10).size(), 3U);
  EXPECT_THAT(jobs().list("", {.until = submitted - std::chrono::minutes(1)}, "", 10), IsEmpty());
}

// A client compares them with those that jobs tell. The clock of a daemon is another one than that
// of its database, and may be set back.
TEST_P(JobListConformance, ListsBetweenTimesThatJobsTell) {
  std::vector<Job> all;
  for (const int ahead : {0, 3600, -3600}) {
    const test::ClockSetAhead wrong{std::chrono::seconds(ahead)};
    all.insert(all.begin(), submit());
    for (const Job& first : all) {
      const Time begin = time_of(first.created);
      for (const Time end : {begin, begin + milliseconds(1), begin + std::chrono::hours(3)}) {
        std::vector<std::string> until;
        std::vector<std::string> between;
        for (const Job& job : all) {
          const Time created = time_of(job.created);
          if (created < end) until.push_back(job.id);
          if (begin <= created && created < end) between.push_back(job.id);
        }
        EXPECT_EQ(ids_of(jobs().list("", {.until = end}, "", 9)), until);
        EXPECT_EQ(ids_of(jobs().list(std::nullopt, {.since = begin, .until = end}, "", 9)),
                  between);
      }
    }
  }
}

TEST_P(JobListConformance, ListsOfAVolumeAreThoseOfAllOwnersForAnAdministrator) {
  const std::string mine = submit(parameters(), "").id;
  const std::string theirs = submit(parameters(), "other").id;
  EXPECT_THAT(ids_of(jobs().list(std::nullopt, {.volume = kVolume}, "", 10)),
              ElementsAre(theirs, mine));
  EXPECT_THAT(ids_of(jobs().list("other", {.volume = kVolume}, "", 10)), ElementsAre(theirs));
}

// A request's path may name them.
TEST_P(JobListConformance, TextsThatNoDatabaseHasNameNothing) {
  const std::string id = submit().id;
  for (const std::string& wrong : {std::string("\xff"), id + '\0', id + std::string("\0x", 2),
                                   "\xe2\x82" + id, std::string("\xf0\x9f\xa6\xb4")}) {
    EXPECT_EQ(code_thrown_by([&] { jobs().get("", wrong); }), ErrorCode::kNotFound);
    EXPECT_EQ(code_thrown_by([&] { jobs().cancel("", wrong); }), ErrorCode::kNotFound);
    EXPECT_EQ(code_thrown_by([&] { volumes().get("", kVolume + wrong); }), ErrorCode::kNotFound);
    EXPECT_THAT(jobs().list("", {.volume = kVolume + wrong}, "", 9), IsEmpty());
    EXPECT_THAT(jobs().list(wrong, {}, "", 9), IsEmpty());
  }
  EXPECT_EQ(jobs().get("", id).state, JobState::kQueued);
}

TEST_P(JobListConformance, ACursorNeedNotNameAJob) {
  const std::string id = submit().id;
  EXPECT_THAT(jobs().list("", {}, "0", 10), IsEmpty());
  EXPECT_THAT(ids_of(jobs().list("", {}, "~", 10)), ElementsAre(id));
}

// --- Owners

TEST_P(JobListConformance, AnOwnerSeesItsOwnOnly) {
  const std::string mine = submit(parameters(), "").id;
  const std::string theirs = submit(parameters(), "other").id;
  EXPECT_EQ(code_thrown_by([&] { jobs().get("", theirs); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs().cancel("", theirs); }), ErrorCode::kNotFound);
  EXPECT_THAT(ids_of(jobs().list("other", {}, "", 10)), ElementsAre(theirs));
  EXPECT_THAT(ids_of(jobs().list(std::nullopt, {}, "", 10)), ElementsAre(theirs, mine));
  EXPECT_EQ(jobs().get(std::nullopt, theirs).id, theirs);
  EXPECT_THAT(jobs().events("", theirs, 0, milliseconds(0)), IsEmpty());
  EXPECT_EQ(test::events_of(jobs(), "other", "", 1).size(), 1U);
}

TEST_P(JobListConformance, AnOwnersVolumeIsNoOthers) {
  add_volume("other", "theirs");
  JobParameters stolen = parameters();
  stolen.volume = "theirs";
  EXPECT_EQ(code_thrown_by([&] { submit(stolen, ""); }), ErrorCode::kNotFound);
}

}  // namespace
}  // namespace isomesh::store
