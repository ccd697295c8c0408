#include "server/store/volume_store.h"

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::code_thrown_by;

Volume volume_of(const std::string& id, const std::string& created) {
  Volume volume;
  volume.id = id;
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

class VolumeStoreTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
};

TEST_F(VolumeStoreTest, FindsWhatWasAdded) {
  VolumeStore store(data_);
  const Volume volume = volume_of("aa", "2024-01-01T00:00:00.000Z");
  EXPECT_FALSE(store.contains("aa"));
  EXPECT_EQ(code_thrown_by([&] { store.get("aa"); }), ErrorCode::kNotFound);
  EXPECT_EQ(store.add(volume), std::pair(volume, true));
  EXPECT_TRUE(store.contains("aa"));
  EXPECT_EQ(store.get("aa"), volume);
}

TEST_F(VolumeStoreTest, KeepsTheFirstOfTwoWithOneId) {
  VolumeStore store(data_);
  const Volume first = volume_of("aa", "2024-01-01T00:00:00.000Z");
  store.add(first);
  EXPECT_EQ(store.add(volume_of("aa", "2025-01-01T00:00:00.000Z")), std::pair(first, false));
  EXPECT_EQ(store.get("aa"), first);
}

TEST_F(VolumeStoreTest, SurvivesReopening) {
  const Volume volume = volume_of("aa", "2024-01-01T00:00:00.000Z");
  VolumeStore(data_).add(volume);
  VolumeStore reopened(data_);
  EXPECT_EQ(reopened.get("aa"), volume);
  EXPECT_FALSE(reopened.add(volume).second);
  reopened.erase("aa");
  EXPECT_FALSE(VolumeStore(data_).contains("aa"));
}

TEST_F(VolumeStoreTest, ListsTheOldestFirst) {
  VolumeStore store(data_);
  store.add(volume_of("cc", "2024-01-01T00:00:00.000Z"));
  store.add(volume_of("aa", "2024-03-01T00:00:00.000Z"));
  store.add(volume_of("bb", "2024-02-01T00:00:00.000Z"));
  std::string order;
  for (const Volume& volume : store.list()) order += volume.id;
  EXPECT_EQ(order, "ccbbaa");
  EXPECT_EQ(VolumeStore(data_).list(), store.list());
}

TEST_F(VolumeStoreTest, ErasesOnce) {
  VolumeStore store(data_);
  store.add(volume_of("aa", "2024-01-01T00:00:00.000Z"));
  store.erase("aa");
  EXPECT_FALSE(store.contains("aa"));
  EXPECT_TRUE(store.list().empty());
  EXPECT_EQ(code_thrown_by([&] { store.erase("aa"); }), ErrorCode::kNotFound);
  EXPECT_TRUE(store.add(volume_of("aa", "2024-01-02T00:00:00.000Z")).second);
}

TEST_F(VolumeStoreTest, IgnoresWritesThatACrashCutShort) {
  const Volume volume = volume_of("aa", "2024-01-01T00:00:00.000Z");
  VolumeStore(data_).add(volume);
  test::write_file(data_.volumes() / "bb.json.0011.part", "{\"id\": \"bb\", \"for");
  test::write_file(data_.volumes() / "cc.json.2233.part", "");
  EXPECT_EQ(VolumeStore(data_).list(), std::vector{volume});
}

// One record that the disk has spoilt must not cost the others, nor keep the daemon from starting.
TEST_F(VolumeStoreTest, ABrokenRecordDoesNotHideTheOthers) {
  const Volume volume = volume_of("aa", "2024-01-01T00:00:00.000Z");
  VolumeStore(data_).add(volume);
  for (const std::string text : {"", "{", "[]", "{}", "{\"id\": \"other\"}"}) {
    test::write_file(data_.volumes() / "bb.json", text);
    std::vector<Volume> listed;
    EXPECT_EQ(code_thrown_by([&] { listed = VolumeStore(data_).list(); }), std::nullopt) << text;
    EXPECT_EQ(listed, std::vector{volume}) << text;
  }
}

TEST_F(VolumeStoreTest, OneOfManyThreadsAddsIt) {
  VolumeStore store(data_);
  std::atomic<int> added = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&] {
      if (store.add(volume_of("aa", "2024-01-01T00:00:00.000Z")).second) ++added;
    });
  }
  threads.clear();
  EXPECT_EQ(added, 1);
  EXPECT_EQ(store.list().size(), 1U);
}

}  // namespace
}  // namespace isomesh::store
