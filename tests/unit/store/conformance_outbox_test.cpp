// Tests of the outbox on every engine.
#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "proto/json.h"
#include "server/store/job_rules.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using testing::ElementsAre;

class OutboxConformance : public test::EngineTest {
 protected:
  // Submits a job that calls that URL back, and ends it.
  std::string end_with_callback(const std::string& url) {
    JobParameters calling = unlike();
    calling.callback = Callback{url};
    const std::string id = submit(calling).id;
    jobs().cancel("", id);
    return id;
  }

  std::vector<std::string> due(std::size_t per_receiver) {
    std::vector<std::string> jobs;
    for (const Delivery& delivery : outbox().due(now(), per_receiver)) jobs.push_back(delivery.job);
    return jobs;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, OutboxConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(OutboxConformance, HoldsTheEndOfEveryJobThatHasACallback) {
  const std::string silent = submit().id;
  JobParameters calling = unlike();
  calling.callback = Callback{"https://a.example.org/x"};
  const std::string cancelled = submit(calling).id;
  EXPECT_EQ(outbox().count(), 0U);
  jobs().cancel("", cancelled);
  jobs().cancel("", silent);
  const auto due = outbox().due(now(), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].job, cancelled);
  EXPECT_EQ(due[0].url, "https://a.example.org/x");
  EXPECT_EQ(job_from_json(due[0].body), jobs().get("", cancelled));
  EXPECT_EQ(due[0].attempts, 0);
}

// As on a full disk, before the receiver could be reached.
TEST_P(OutboxConformance, TellsOfAJobThatHasExpiredAsTheApiDid) {
  JobParameters calling = unlike();
  calling.callback = Callback{"https://a.example.org/x"};
  const std::string id = submit(calling).id;
  Outcome outcome = some_mesh();
  outcome.mesh->labels_count = 300;
  outcome.mesh->label_list = {9, put_blob("some mesh")};
  ASSERT_TRUE(jobs().finish(claimed(), outcome));
  const std::string told = to_json(jobs().get("", id));
  const auto ended = jobs().ended({.before = now() + std::chrono::hours(1)}, Ended::kAll, 9);
  ASSERT_EQ(jobs().expire(ended, kAllBytes).records.size(), 1U);
  const auto due = outbox().due(now(), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].body, told);
}

// It was postponed while the clock was ahead.
TEST_P(OutboxConformance, AClockThatWasSetBackHoldsUpNone) {
  const std::string job = end_with_callback("https://a.example.org/x");
  const Delivery delivery = outbox().due(now(), 9).at(0);
  outbox().postpone(delivery, now() + std::chrono::hours(1));
  EXPECT_THAT(due(9), testing::IsEmpty());
  outbox().postpone(delivery, now() + std::chrono::days(40));
  EXPECT_THAT(due(9), ElementsAre(job));
}

TEST_P(OutboxConformance, ADamagedBodyHoldsUpNoOther) {
  const std::string damaged = end_with_callback("https://a.example.org/1");
  const std::string other = end_with_callback("https://b.example.org/1");
  damage("callbacks", "body", "job", damaged);
  EXPECT_THAT(due(9), testing::UnorderedElementsAre(damaged, other));
}

TEST_P(OutboxConformance, OfEachReceiverSomeAreDue) {
  const std::string first = end_with_callback("https://a.example.org/1");
  const std::string second = end_with_callback("https://a.example.org/2");
  const std::string third = end_with_callback("https://a.example.org/3");
  const std::string port = end_with_callback("https://a.example.org:8443/");
  const std::string host = end_with_callback("https://b.example.org");
  EXPECT_THAT(due(2), ElementsAre(first, second, port, host));
  EXPECT_EQ(outbox().count(), 5U);
  outbox().remove(outbox().due(now(), 1)[0]);
  EXPECT_THAT(due(2), ElementsAre(second, third, port, host));
}

TEST_P(OutboxConformance, WhatIsPostponedIsDueLater) {
  const std::string job = end_with_callback("https://a.example.org/");
  EXPECT_EQ(outbox().next_after(now()), std::nullopt);
  const auto later = now() + std::chrono::hours(1);
  outbox().postpone(outbox().due(now(), 9)[0], later);
  EXPECT_TRUE(outbox().due(now(), 9).empty());
  EXPECT_LT(std::chrono::abs(*outbox().next_after(now()) - later), std::chrono::milliseconds(1));
  const auto due = outbox().due(later + std::chrono::seconds(1), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].attempts, 1);
}

TEST_P(OutboxConformance, OutlivesARestart) {
  const std::string job = end_with_callback("https://a.example.org/");
  outbox().postpone(outbox().due(now(), 9)[0], now() - std::chrono::seconds(1));
  restart();
  const auto due = outbox().due(now(), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].job, job);
  EXPECT_EQ(due[0].attempts, 1);
}

// Priority and callback change no byte of the mesh, so the key does not depend on them.
TEST(ResultKey, KnowsSamplesParametersAndVersionAlone) {
  JobParameters parameters;
  Volume volume;
  volume.samples = "abc";
  const auto key = [&](const std::string& version) {
    return result_key(volume, parameters, version);
  };
  const std::string first = key("1");
  parameters.priority = Priority::kStat;
  parameters.callback = Callback{"https://a.example.org/"};
  EXPECT_EQ(key("1"), first);
  EXPECT_NE(key("2"), first);
  parameters.normals = !parameters.normals;
  EXPECT_NE(key("1"), first);
  parameters.normals = !parameters.normals;
  parameters.min_thickness_mm = 0.4;
  EXPECT_NE(key("1"), first);
  parameters.min_thickness_mm = {};
  volume.samples = "abd";
  EXPECT_NE(key("1"), first);
  volume.samples = "abc";
  volume.id = "another patient's";
  parameters.volume = volume.id;
  EXPECT_EQ(key("1"), first);
  volume.suggested_iso = 1;
  EXPECT_NE(key("1"), first);
  parameters.iso = 5;
  const std::string by_value = key("1");
  volume.suggested_iso = 0;
  EXPECT_EQ(key("1"), by_value);
}

// Those that a mesh carries, and no others.
TEST(ResultKey, KnowsTheNotesInMeshes) {
  const auto key = [](const std::vector<Note>& notes) {
    Volume volume;
    volume.notes = notes;
    return result_key(volume, {}, "1");
  };
  const Note in_mesh = note_of(NoteCode::kFormsDiffer, "by 3 mm");
  EXPECT_NE(key({in_mesh}), key({}));
  EXPECT_NE(key({in_mesh}), key({note_of(NoteCode::kFormsDiffer, "by 4 mm")}));
  EXPECT_EQ(key({note_of(NoteCode::kTrailingBytes, "3 bytes")}), key({}));
}

}  // namespace
}  // namespace isomesh::store
