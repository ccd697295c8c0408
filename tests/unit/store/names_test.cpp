#include "server/store/sql/names.h"

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::store {
namespace {

TEST(NamesInSql, BecomeTheNumbersOfTheTables) {
  EXPECT_EQ(with_numbers("state = {job.queued} OR state < {job.final}"), "state = 0 OR state < 2");
  EXPECT_EQ(with_numbers("SELECT ?1"), "SELECT ?1");
  EXPECT_EQ(with_numbers("{stage.done}"), "'done'");
  EXPECT_EQ(with_numbers("{callback.longest_us}"), "86400000000");
  EXPECT_EQ(with_numbers("record = '{}' AND stage = {stage.done}"),
            "record = '{}' AND stage = 'done'");
}

TEST(NamesInSql, AnUnknownOneIsAnError) {
  for (const char* sql : {"state = {job.sleeping}", "state = { }", "state = {job.queued"}) {
    EXPECT_EQ(test::code_thrown_by([&] { with_numbers(sql); }), ErrorCode::kInternal) << sql;
  }
}

}  // namespace
}  // namespace isomesh::store
