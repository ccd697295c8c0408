#include "server/store/room.h"

#include <gtest/gtest.h>

#include "proto/error.h"
#include "tests/support/errors.h"

namespace isomesh::store {
namespace {

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
