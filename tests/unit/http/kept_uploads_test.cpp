#include "server/http/kept_uploads.h"

#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "proto/error.h"

namespace isomesh::http {
namespace {

using std::chrono_literals::operator""ms;

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
  KeptUploads kept({.time = 300ms});
  Thing asked_for;
  Thing forgotten;
  const std::string name = kept.keep("a", asked_for.give());
  kept.keep("b", forgotten.give());
  std::this_thread::sleep_for(200ms);
  kept.find("a", name);
  for (int i = 0; i < 100 && forgotten.is_there(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(forgotten.is_there());
  EXPECT_TRUE(asked_for.is_there());
  for (int i = 0; i < 200 && asked_for.is_there(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(asked_for.is_there());
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

}  // namespace
}  // namespace isomesh::http
