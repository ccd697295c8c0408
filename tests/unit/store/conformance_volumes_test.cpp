// Tests of volumes on every engine.
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/support/errors.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using test::code_thrown_by;

Volume volume_of(const std::string& id, const std::string& created = "2024-01-01T00:00:00.000Z") {
  Volume volume;
  volume.id = id;
  volume.samples = id;
  volume.format = "nrrd";
  volume.dims = {3, 4, 5};
  volume.type = SampleType::kInt16;
  volume.geometry.spacing = {0.1, 0.2, 1.0 / 3};
  volume.range = {-1000, 3000};
  volume.suggested_iso = 0.1;
  volume.bytes = 120;
  volume.created = created;
  return volume;
}

class VolumeConformance : public test::EngineTest {
 protected:
  VolumeConformance() {
    volumes().erase("", kVolume);
    volumes().erase("other", kVolume);
  }

  std::string order(const std::string& after = {}, std::size_t limit = 100,
                    ListOrder order = ListOrder::kOldestFirst) {
    std::string ids;
    for (const Volume& volume : volumes().list("", after, limit, order)) ids += volume.id;
    return ids;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, VolumeConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(VolumeConformance, FindsWhatWasAdded) {
  const Volume volume = volume_of("aa");
  EXPECT_FALSE(volumes().contains("", "aa"));
  EXPECT_EQ(code_thrown_by([&] { volumes().get("", "aa"); }), ErrorCode::kNotFound);
  EXPECT_EQ(volumes().add("", volume), std::pair(volume, true));
  EXPECT_TRUE(volumes().contains("", "aa"));
  EXPECT_EQ(volumes().get("", "aa"), volume);
  restart();
  EXPECT_EQ(volumes().get("", "aa"), volume);
}

TEST_P(VolumeConformance, KeepsTheFirstOfTwoWithOneId) {
  const Volume first = volume_of("aa");
  volumes().add("", first);
  EXPECT_EQ(volumes().add("", volume_of("aa", "2025-01-01T00:00:00.000Z")),
            std::pair(first, false));
  EXPECT_EQ(volumes().get("", "aa"), first);
}

// Samples are stored once, also for one owner, and stay until their last record goes.
TEST_P(VolumeConformance, RecordsShareTheirSamples) {
  const std::string samples = put_blob("abcd");
  const auto shared = [&](const std::string& id) {
    Volume volume = volume_of(id);
    volume.samples = samples;
    volume.bytes = 4;
    return volume;
  };
  EXPECT_FALSE(volumes().has_samples("", samples));
  for (const char* id : {"aa", "bb"}) EXPECT_TRUE(volumes().add("", shared(id)).second) << id;
  EXPECT_TRUE(volumes().has_samples("", samples));
  EXPECT_FALSE(volumes().has_samples("other", samples));
  EXPECT_EQ(volumes().samples_of("", "bb"), samples);
  EXPECT_EQ(volumes().samples_of("other", "bb"), std::nullopt);
  EXPECT_EQ(volumes().named_bytes(), 4U);
  EXPECT_EQ(volumes().owned_bytes(), (OwnedBytes{{"", 4}}));
  volumes().erase("", "aa");
  EXPECT_TRUE(volumes().names(samples));
  volumes().erase("", "bb");
  EXPECT_FALSE(volumes().names(samples));
}

TEST_P(VolumeConformance, TheKeyOfIdsStays) {
  const std::string key = volumes().key();
  EXPECT_EQ(key.size(), 64U);
  restart();
  EXPECT_EQ(volumes().key(), key);
}

TEST_P(VolumeConformance, ANameIsItsOwnersAlone) {
  Volume volume = volume_of("aa");
  volume.name = "ct.nrrd";
  volume.notes = {note_of(NoteCode::kFormsDiffer, "by 3 mm")};
  volumes().add("", volume);
  volumes().add("other", volume);
  volume.name = "head";
  EXPECT_EQ(volumes().rename("", "aa", "head"), volume);
  restart();
  EXPECT_EQ(volumes().get("", "aa"), volume);
  EXPECT_EQ(volumes().get("other", "aa").name, "ct.nrrd");
  EXPECT_EQ(volumes().rename("", "aa", std::nullopt).name, std::nullopt);
  EXPECT_EQ(code_thrown_by([&] { volumes().rename("nobody", "aa", "x"); }), ErrorCode::kNotFound);
}

TEST_P(VolumeConformance, LabelsAreItsOwnersAloneAndInNoList) {
  Volume named = volume_of("aa");
  named.labels = {{.label = 3, .name = "liver", .color = "#ff8000", .values = {3, 9}}};
  volumes().add("", named);
  volumes().add("other", volume_of("aa"));
  restart();
  EXPECT_EQ(volumes().get("", "aa"), named);
  EXPECT_THAT(volumes().get("other", "aa").labels, testing::IsEmpty());
  EXPECT_EQ(volumes().list(""), std::vector{volume_of("aa")});
  EXPECT_EQ(volumes().rename("", "aa", "head").labels, named.labels);
  EXPECT_EQ(volumes().get("", "aa").labels, named.labels);
}

TEST_P(VolumeConformance, OwnersHaveRecordsOfTheirOwn) {
  const Volume mine = volume_of("aa");
  const Volume theirs = volume_of("aa", "2025-01-01T00:00:00.000Z");
  EXPECT_TRUE(volumes().add("", mine).second);
  EXPECT_FALSE(volumes().contains("other", "aa"));
  EXPECT_TRUE(volumes().add("other", theirs).second);
  EXPECT_EQ(volumes().get("", "aa"), mine);
  EXPECT_EQ(volumes().get("other", "aa"), theirs);
  EXPECT_EQ(volumes().list("other").size(), 1U);
  volumes().erase("", "aa");
  EXPECT_EQ(code_thrown_by([&] { volumes().get("", "aa"); }), ErrorCode::kNotFound);
  EXPECT_EQ(volumes().get("other", "aa"), theirs);
  EXPECT_TRUE(volumes().names("aa"));
  volumes().erase("other", "aa");
  EXPECT_FALSE(volumes().names("aa"));
}

// Who sees everybody's erases what it sees.
TEST_P(VolumeConformance, TheServiceErasesEveryOwnersRecord) {
  volumes().add("one", volume_of("aa"));
  volumes().add("other", volume_of("aa"));
  volumes().add("other", volume_of("bb"));
  volumes().erase(std::nullopt, "aa");
  EXPECT_FALSE(volumes().names("aa"));
  EXPECT_TRUE(volumes().names("bb"));
  EXPECT_EQ(code_thrown_by([&] { volumes().erase(std::nullopt, "aa"); }), ErrorCode::kNotFound);
}

TEST_P(VolumeConformance, ListsTheOldestFirstInPages) {
  const Volume second = volume_of("bb", "2024-02-01T00:00:00.000Z");
  volumes().add("", volume_of("cc", "2024-01-01T00:00:00.000Z"));
  volumes().add("", volume_of("aa", "2024-03-01T00:00:00.000Z"));
  volumes().add("", volume_of("dd", "2024-02-01T00:00:00.000Z"));
  volumes().add("", second);
  EXPECT_EQ(order(), "ccbbddaa");
  EXPECT_EQ(order("", 2), "ccbb");
  EXPECT_EQ(order(cursor_of(second), 1), "dd");
  EXPECT_EQ(order(cursor_of(second), 9), "ddaa");
  EXPECT_EQ(order("no cursor", 9), "ccbbddaa");
  EXPECT_EQ(order("", 9, ListOrder::kNewestFirst), "aaddbbcc");
  EXPECT_EQ(order("", 2, ListOrder::kNewestFirst), "aadd");
  EXPECT_EQ(order(cursor_of(second), 9, ListOrder::kNewestFirst), "cc");
}

// Whatever the damage is: the others are listed, with the places of the pages that they had.
TEST_P(VolumeConformance, ADamagedRecordHidesNoOther) {
  for (const char* damaged :
       {"'#' || substr(record, 2)", "''", "replace(record, '\"id\":\"bb\"', '\"id\":\"bc\"')",
        "replace(record, '\"created\":\"2024', '\"created\":\"2025')",
        "replace(record, '\"type\":\"int16\"', '\"type\":\"int17\"')",
        "replace(record, '\"bytes\":120', '\"bytes\":-20')"}) {
    volumes().add("", volume_of("cc", "2024-01-01T00:00:00.000Z"));
    volumes().add("", volume_of("bb", "2024-02-01T00:00:00.000Z"));
    volumes().add("", volume_of("aa", "2024-03-01T00:00:00.000Z"));
    database().run(Change::kRepeatable,
                   std::string("UPDATE volumes SET record = ") + damaged + " WHERE id = 'bb'");
    EXPECT_EQ(order(), "ccaa") << damaged;
    EXPECT_EQ(order("", 1), "cc") << damaged;
    EXPECT_EQ(order(cursor_of(volume_of("cc", "2024-01-01T00:00:00.000Z")), 1), "aa") << damaged;
    EXPECT_EQ(order("", 9, ListOrder::kNewestFirst), "aacc") << damaged;
    for (const char* id : {"aa", "bb", "cc"}) volumes().erase("", id);
  }
}

TEST_P(VolumeConformance, ADamagedRecordSaysSoToWhoNeedsIt) {
  volumes().add("", volume_of("bb"));
  damage("volumes", "bb");
  JobParameters parameters;
  parameters.volume = "bb";
  const Error fetched = test::error_of([&] { volumes().get("", "bb"); });
  const Error submitted = test::error_of([&] { jobs().submit({"", parameters, "", ""}); });
  ASSERT_EQ(fetched.fields().size(), 1U);
  ASSERT_EQ(submitted.fields().size(), 1U);
  EXPECT_EQ(fetched.fields()[0].field, "id");
  EXPECT_EQ(submitted.fields()[0].field, "volume");
  EXPECT_THAT(submitted.fields()[0].message, testing::HasSubstr("damaged"));
}

TEST_P(VolumeConformance, ErasesOnce) {
  volumes().add("", volume_of("aa"));
  volumes().erase("", "aa");
  EXPECT_FALSE(volumes().contains("", "aa"));
  EXPECT_EQ(code_thrown_by([&] { volumes().erase("", "aa"); }), ErrorCode::kNotFound);
  EXPECT_TRUE(volumes().add("", volume_of("aa")).second);
}

TEST_P(VolumeConformance, KeepsWhatAJobNeeds) {
  volumes().add("", volume_of(kVolume));
  const std::string id = submit().id;
  EXPECT_EQ(code_thrown_by([&] { volumes().erase("", kVolume); }), ErrorCode::kNotReady);
  const Lease lease = claimed();
  EXPECT_EQ(code_thrown_by([&] { volumes().erase("", kVolume); }), ErrorCode::kNotReady);
  EXPECT_TRUE(volumes().contains("", kVolume));
  jobs().finish(lease, some_mesh());
  volumes().erase("", kVolume);
  EXPECT_EQ(jobs().get("", id).state, JobState::kSucceeded);
}

TEST_P(VolumeConformance, ErasesTheJobsThatWereMadeOfIt) {
  volumes().add("", volume_of(kVolume));
  volumes().add("other", volume_of(kVolume));
  const std::string blob = put_blob("some mesh");
  const std::string made = submit().id;
  jobs().finish(claimed(), some_mesh());
  const std::string elsewhere = submit(parameters(), "other").id;
  jobs().finish(claimed(), some_mesh());
  const std::string cancelled = submit().id;
  std::vector<std::string> going;
  const auto erase = [&] {
    volumes().erase("", kVolume, Made::kErased, [&](std::span<const std::string> keys) {
      going.insert(going.end(), keys.begin(), keys.end());
    });
  };
  EXPECT_EQ(code_thrown_by(erase), ErrorCode::kNotReady);
  EXPECT_EQ(jobs().get("", made).state, JobState::kSucceeded);
  jobs().cancel("", cancelled);
  going.clear();
  erase();
  EXPECT_EQ(code_thrown_by([&] { jobs().get("", made); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs().get("", cancelled); }), ErrorCode::kNotFound);
  EXPECT_EQ(jobs().get("other", elsewhere).state, JobState::kSucceeded);
  EXPECT_TRUE(volumes().contains("other", kVolume));
  EXPECT_THAT(going, testing::UnorderedElementsAre(kVolume, blob));
}

TEST_P(VolumeConformance, OneOfManyThreadsAddsIt) {
  std::atomic<int> added = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&] {
      if (volumes().add("", volume_of("aa")).second) ++added;
    });
  }
  threads.clear();
  EXPECT_EQ(added, 1);
  EXPECT_EQ(volumes().list("").size(), 1U);
}

}  // namespace
}  // namespace isomesh::store
