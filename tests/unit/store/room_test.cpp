#include "server/store/files/room.h"

#include <gtest/gtest.h>

#include "proto/error.h"
#include "tests/support/errors.h"

namespace isomesh::store {
namespace {

TEST(Room, IsMadeWhereThereIsNone) {
  Room room;
  int made = 0;
  room.limit(100, [&](const Incoming& incoming) {
    EXPECT_EQ(incoming.bytes, 60U);
    ++made;
    room.give(50);
  });
  room.take(80, "");
  room.take(20, "");
  EXPECT_EQ(made, 0);
  room.give(10);
  room.take(60, "");
  EXPECT_EQ(made, 1);
  EXPECT_EQ(room.used(), 100U);
}

TEST(Room, IsNeverMoreThanItsBytes) {
  Room room;
  int asked = 0;
  room.limit(100, [&](const Incoming& /*incoming*/) { ++asked; });
  room.take(100, "");
  EXPECT_EQ(test::code_thrown_by([&] { room.take(1, ""); }), ErrorCode::kOutOfSpace);
  EXPECT_GT(asked, 0);
  EXPECT_EQ(room.used(), 100U);
  asked = 0;
  EXPECT_EQ(test::code_thrown_by([&] { room.take(101, ""); }), ErrorCode::kOutOfSpace);
  EXPECT_EQ(asked, 0) << "nothing expires for what never fits";
}

TEST(Room, IsMadeForTheOwnerOfWhatIsWritten) {
  Room room;
  Incoming seen;
  room.limit(100, [&](const Incoming& incoming) {
    seen = incoming;
    room.give(10);
  });
  room.take(30, "one");
  room.take(20, "one");
  room.take(50, "other");
  room.take(10, "one");
  EXPECT_EQ(seen.owner, "one");
  EXPECT_EQ(seen.bytes, 10U);
  EXPECT_EQ(seen.unfinished, 50U);
  room.finish(60, "one");
  room.take(10, "one");
  EXPECT_EQ(seen.unfinished, 0U);
}

TEST(Room, KeepsTheBooks) {
  Room room;
  room.take(30, "");
  room.correct(10, 25);  // ten of them became 25, as the file that they replaced was not counted
  EXPECT_EQ(room.used(), 45U);
  room.give(100);
  EXPECT_EQ(room.used(), 0U);
}

}  // namespace
}  // namespace isomesh::store
