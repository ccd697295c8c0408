#include "server/store/files/reserve.h"

#include <gtest/gtest.h>

#include "tests/support/files.h"

namespace isomesh::store {
namespace {

constexpr std::uint64_t kBytes = 1 << 20;

TEST(Reserve, TakesRoomAndLetsItGoOnce) {
  const test::TemporaryFolder folder;
  Reserve reserve(folder / "reserve", kBytes);
  EXPECT_EQ(std::filesystem::file_size(folder / "reserve"), kBytes);
  EXPECT_TRUE(reserve.has_room());
  reserve.let_go();
  reserve.let_go();
  EXPECT_FALSE(std::filesystem::exists(folder / "reserve"));
  EXPECT_TRUE(reserve.has_room()) << "it is taken again where there is room";
  EXPECT_EQ(std::filesystem::file_size(folder / "reserve"), kBytes);
}

TEST(Reserve, IsTheSameAfterARestart) {
  const test::TemporaryFolder folder;
  { const Reserve reserve(folder / "reserve", kBytes); }
  Reserve again(folder / "reserve", kBytes);
  EXPECT_TRUE(again.has_room());
  again.let_go();
  EXPECT_FALSE(std::filesystem::exists(folder / "reserve"));
}

TEST(Reserve, OfNothingIsAlwaysThere) {
  const test::TemporaryFolder folder;
  Reserve reserve(folder / "reserve", 0);
  EXPECT_TRUE(reserve.has_room());
  reserve.let_go();
  EXPECT_FALSE(std::filesystem::exists(folder / "reserve"));
}

// No disk has so much.
TEST(Reserve, ThatCannotBeTakenLeavesNothingAndHasNoRoom) {
  const test::TemporaryFolder folder;
  Reserve reserve(folder / "reserve", std::uint64_t{1} << 60);
  EXPECT_FALSE(reserve.has_room());
  EXPECT_FALSE(std::filesystem::exists(folder / "reserve"));
}

}  // namespace
}  // namespace isomesh::store
