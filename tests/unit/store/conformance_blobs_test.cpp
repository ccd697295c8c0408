// Tests that every blob store must pass.
#include <atomic>
#include <chrono>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/stores.h"
#include "tests/unit/store/blob_engines.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;
using test::NamedBlobEngine;

// The digest of "hello".
constexpr const char* kHelloKey =
    "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824";

// Some stores know times to the second only.
constexpr std::chrono::hours kAWhile{1};

class Blobs : public testing::TestWithParam<NamedBlobEngine> {
 protected:
  void SetUp() override {
    if (const std::string missing = GetParam().missing(); !missing.empty()) {
      GTEST_SKIP() << missing;
    }
    engine_ = GetParam().make();
    blobs_ = engine_->open();
  }

  Blob put(std::string_view text) { return test::put(*blobs_, text); }

  // One that a record names.
  Blob put_named(std::string_view text) {
    const Blob blob = put(text);
    blobs_->mark_named(blob.key);
    return blob;
  }

  std::string get(const std::string& key) { return test::get(*blobs_, key); }

  static bool nothing(const std::string& /*key*/) { return false; }
  static Steady in(std::chrono::seconds time) { return Steady::clock::now() + time; }
  static Time at(std::chrono::seconds time) { return std::chrono::system_clock::now() + time; }

  std::unique_ptr<test::BlobEngine> engine_;
  std::unique_ptr<BlobStore> blobs_;
};

TEST_P(Blobs, ABlobIsNamedByItsBytes) {
  const Blob blob = put("hello");
  EXPECT_EQ(blob.key, kHelloKey);
  EXPECT_EQ(blob.bytes, 5U);
  EXPECT_EQ(get(kHelloKey), "hello");
}

TEST_P(Blobs, AreThereOnlyAfterTheirCommit) {
  const auto writer = blobs_->begin("");
  writer->write(as_span("hel"));
  writer->write(as_span("lo"));
  EXPECT_TRUE(blobs_->is_empty());
  EXPECT_EQ(code_thrown_by([&] { blobs_->open(kHelloKey); }), ErrorCode::kNotFound);
  EXPECT_EQ(writer->commit().key, kHelloKey);
  EXPECT_FALSE(blobs_->is_empty());
  EXPECT_EQ(get(kHelloKey), "hello");
}

TEST_P(Blobs, AWriterThatIsGivenUpLeavesNothing) {
  {
    const auto writer = blobs_->begin("");
    writer->write(as_span("hello"));
    EXPECT_EQ(engine_->leftovers().size(), 1U);
  }
  EXPECT_EQ(engine_->leftovers(), std::vector<std::string>());
  EXPECT_TRUE(blobs_->is_empty());
}

TEST_P(Blobs, AWriterThatCommitsLeavesTheBlobOnly) {
  put_named("hello");
  EXPECT_EQ(engine_->leftovers(), std::vector<std::string>());
}

TEST_P(Blobs, TheSameBytesAreOneBlob) {
  EXPECT_EQ(put("hello").key, put("hello").key);
  EXPECT_EQ(blobs_->bytes(), 5U);
  EXPECT_NE(put("hallo").key, kHelloKey);
  EXPECT_EQ(blobs_->bytes(), 10U);
}

TEST_P(Blobs, AnEmptyBlobIsABlob) {
  const Blob blob = put("");
  EXPECT_EQ(blob.bytes, 0U);
  EXPECT_EQ(get(blob.key), "");
}

TEST_P(Blobs, AnyPartCanBeRead) {
  const auto reader = blobs_->open(put("hello").key);
  std::string text(3, '\0');
  EXPECT_EQ(reader->read_at(3, std::as_writable_bytes(std::span(text))), 2U);
  EXPECT_EQ(text.substr(0, 2), "lo");
  EXPECT_EQ(reader->read_at(1, std::as_writable_bytes(std::span(text))), 3U);
  EXPECT_EQ(text, "ell");
}

TEST_P(Blobs, WritersDoNotMeet) {
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([this, thread] {
      for (int n = 0; n < 5; ++n) put_named("common");
      for (int n = 0; n < 5; ++n) put_named(std::to_string(thread * 100 + n));
    });
  }
  threads.clear();
  EXPECT_EQ(blobs_->bytes(), 6U + 5 * 1 + 3 * 5 * 3);
  EXPECT_EQ(engine_->leftovers(), std::vector<std::string>());
}

TEST_P(Blobs, AFinishedFileIsTakenOver) {
  const std::string text(3 << 20, 'x');
  const std::filesystem::path file = engine_->write_file(text);
  const Blob blob = digest_of(file);
  blobs_->adopt(file, blob, "", {});
  EXPECT_EQ(blob.bytes, text.size());
  EXPECT_EQ(blob.key, put(text).key);
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_TRUE(get(blob.key) == text);
}

TEST_P(Blobs, ErasingOneLeavesTheOthers) {
  put("hello");
  const std::string other = put("other").key;
  blobs_->erase(kHelloKey);
  EXPECT_EQ(code_thrown_by([&] { blobs_->open(kHelloKey); }), ErrorCode::kNotFound);
  EXPECT_EQ(get(other), "other");
  blobs_->erase(kHelloKey);
  EXPECT_EQ(blobs_->bytes(), 5U);
}

TEST_P(Blobs, AnOpenBlobOutlivesItsErasing) {
  put("hello");
  const auto blob = blobs_->open(kHelloKey);
  blobs_->erase(kHelloKey);
  std::string text(5, '\0');
  EXPECT_EQ(blob->read_at(0, std::as_writable_bytes(std::span(text))), 5U);
  EXPECT_EQ(text, "hello");
}

TEST_P(Blobs, TellSizesAndPlaces) {
  put("hello");
  EXPECT_EQ(blobs_->size(kHelloKey), 5U);
  const LocalBlob local = blobs_->local(kHelloKey);
  EXPECT_EQ(test::read_file(local.path), "hello");
  blobs_->erase(kHelloKey);
  EXPECT_EQ(blobs_->size(kHelloKey), std::nullopt);
  EXPECT_EQ(code_thrown_by([&] { blobs_->local(kHelloKey); }), ErrorCode::kNotFound);
}

TEST_P(Blobs, BytesThatAreNotTheKeysAreKnownAndReplaced) {
  put("hello");
  EXPECT_TRUE(blobs_->is_intact(kHelloKey, {}));
  EXPECT_TRUE(blobs_->is_intact(kHelloKey, {}));
  engine_->spoil(kHelloKey, "hallo");
  EXPECT_FALSE(blobs_->is_intact(kHelloKey, {}));
  EXPECT_FALSE(blobs_->is_intact(kHelloKey, {}));
  put("hello");
  EXPECT_TRUE(blobs_->is_intact(kHelloKey, {}));
  EXPECT_TRUE(engine_->open()->is_intact(kHelloKey, {})) << "in the place that all look at";
  blobs_->erase(kHelloKey);
  EXPECT_EQ(code_thrown_by([&] { blobs_->is_intact(kHelloKey, {}); }), ErrorCode::kNotFound);
  EXPECT_FALSE(is_there_and_intact(*blobs_, kHelloKey, {}));
}

TEST_P(Blobs, WhoseTheyAreIsSaidInAMark) {
  EXPECT_EQ(blobs_->mark(), "");
  blobs_->set_mark("somebody 1\n");
  blobs_->set_mark("somebody 2\n");
  EXPECT_EQ(blobs_->mark(), "somebody 2\n");
  EXPECT_TRUE(blobs_->is_empty()) << "a mark is no blob";
  EXPECT_EQ(blobs_->sweep(in(kAWhile), nothing).quarantined, 0U);
  EXPECT_EQ(engine_->open()->mark(), "somebody 2\n");
}

TEST_P(Blobs, AnswerAndHaveRoom) {
  EXPECT_TRUE(blobs_->responds());
  EXPECT_TRUE(blobs_->has_room());
  EXPECT_GT(blobs_->capacity(), 5U);
  EXPECT_EQ(blobs_->is_shared(), GetParam().is_shared);
}

TEST_P(Blobs, WhatDoesNotFitIsRefusedOrMakesRoom) {
  std::uint64_t asked = 0;
  blobs_->limit_room(8, [&](const Incoming& incoming) {
    asked = incoming.bytes;
    blobs_->erase(kHelloKey);
  });
  put("hello");
  EXPECT_EQ(code_thrown_by([&] { put("far too long"); }), ErrorCode::kTooLarge);
  EXPECT_EQ(asked, 0U);
  put("other");
  EXPECT_EQ(asked, 5U);
  EXPECT_EQ(blobs_->size(kHelloKey), std::nullopt);
  EXPECT_EQ(blobs_->bytes(), 5U);
}

TEST_P(Blobs, RoomIsMadeForTheOwnerOfTheBytes) {
  std::vector<Incoming> asked;
  blobs_->limit_room(10, [&](const Incoming& incoming) {
    asked.push_back(incoming);
    blobs_->erase(kHelloKey);
  });
  put("hello");
  auto first = blobs_->begin("one");
  first->write(as_span("12345"));
  first->commit();
  {
    const auto second = blobs_->begin("one");
    second->write(as_span("678"));
    second->commit();
  }
  ASSERT_EQ(asked.size(), 1U);
  EXPECT_EQ(asked[0].owner, "one");
  EXPECT_EQ(asked[0].bytes, 3U);
  EXPECT_EQ(asked[0].unfinished, 5U) << "another file of the same job";
  first.reset();
  EXPECT_EQ(code_thrown_by([&] { test::put(*blobs_, "90a", "one"); }), ErrorCode::kOutOfSpace);
  EXPECT_EQ(asked.back().unfinished, 0U);
}

TEST_P(Blobs, WhatIsNotNamedGoesIntoQuarantine) {
  const std::string other = put("other").key;
  put("hello");
  put("more");
  std::set<std::string> asked;
  const Names names = [&](const std::string& key) {
    asked.insert(key);
    return key == kHelloKey;
  };
  const Swept swept = blobs_->sweep(in(kAWhile), names);
  EXPECT_EQ(swept.quarantined, 2U);
  EXPECT_EQ(swept.left, 0U);
  EXPECT_EQ(asked.size(), 3U);
  EXPECT_EQ(blobs_->empty_quarantine(at(kAWhile), names), 2U);
  EXPECT_EQ(get(kHelloKey), "hello");
  EXPECT_EQ(blobs_->size(other), std::nullopt);
  EXPECT_EQ(blobs_->bytes(), 5U);
}

TEST_P(Blobs, AShareOfAllAtMostGoesThere) {
  for (int n = 0; n < 40; ++n) put(std::to_string(n));
  const Swept swept = blobs_->sweep(in(kAWhile), nothing);
  EXPECT_EQ(swept.quarantined, 16U);
  EXPECT_EQ(swept.left, 24U);
}

TEST_P(Blobs, WhatIsInQuarantineIsThereForWhoeverAsks) {
  put("hello");
  EXPECT_EQ(blobs_->sweep(in(kAWhile), nothing).quarantined, 1U);
  EXPECT_EQ(get(kHelloKey), "hello");
  EXPECT_EQ(blobs_->size(kHelloKey), 5U);
}

TEST_P(Blobs, TheQuarantineHasAnEnd) {
  put("hello");
  blobs_->sweep(in(kAWhile), nothing);
  EXPECT_EQ(blobs_->empty_quarantine(at(-kAWhile), nothing), 0U);
  EXPECT_EQ(blobs_->empty_quarantine(at(kAWhile), nothing), 1U);
  EXPECT_EQ(code_thrown_by([&] { blobs_->open(kHelloKey); }), ErrorCode::kNotFound);
  EXPECT_EQ(blobs_->empty_quarantine(at(kAWhile), nothing), 0U);
}

TEST_P(Blobs, WhatIsNamedByThenComesBackFromQuarantine) {
  put("hello");
  blobs_->sweep(in(kAWhile), nothing);
  const auto named = [](const std::string& /*key*/) { return true; };
  EXPECT_EQ(blobs_->empty_quarantine(at(kAWhile), named), 0U);
  EXPECT_EQ(blobs_->empty_quarantine(at(kAWhile), nothing), 0U) << "it is there no more";
  EXPECT_EQ(get(kHelloKey), "hello");
}

TEST_P(Blobs, WhatWasStoredSinceIsLeft) {
  put("hello");
  const std::vector<std::string> keys = {kHelloKey};
  EXPECT_EQ(blobs_->sweep(in(-kAWhile), nothing).quarantined, 0U);
  EXPECT_EQ(blobs_->erase_unnamed(keys, in(-kAWhile), nothing), keys);
  EXPECT_EQ(get(kHelloKey), "hello");
}

TEST_P(Blobs, WhatWasNamedAndIsNotAnyMoreGoesAtOnce) {
  put("hello");
  put("hello");  // by another worker, which is about to name it
  const std::vector<std::string> keys = {kHelloKey};
  blobs_->mark_named(kHelloKey);
  EXPECT_EQ(blobs_->erase_unnamed(keys, in(-kAWhile), nothing), keys);
  blobs_->mark_named(kHelloKey);
  EXPECT_TRUE(blobs_->erase_unnamed(keys, in(-kAWhile), nothing).empty());
  EXPECT_EQ(blobs_->size(kHelloKey), std::nullopt);
  EXPECT_EQ(engine_->leftovers(), std::vector<std::string>());
}

TEST_P(Blobs, WhatIsNamedIsNotErased) {
  put_named("hello");
  const std::vector<std::string> keys = {kHelloKey};
  const auto named = [](const std::string& /*key*/) { return true; };
  EXPECT_TRUE(blobs_->erase_unnamed(keys, in(kAWhile), named).empty());
  EXPECT_EQ(get(kHelloKey), "hello");
}

INSTANTIATE_TEST_SUITE_P(Every, Blobs, testing::ValuesIn(test::all_blob_engines()),
                         test::name_of_blobs);

// Several daemons that share one store.
class SharedBlobs : public Blobs {
 protected:
  void SetUp() override {
    Blobs::SetUp();
    if (engine_) other_ = engine_->open();
  }

  std::unique_ptr<BlobStore> other_;
};

TEST_P(SharedBlobs, WhatOneStoresTheOtherHas) {
  put("hello");
  EXPECT_EQ(test::get(*other_, kHelloKey), "hello");
  EXPECT_TRUE(other_->is_intact(kHelloKey, {}));
  other_->erase(kHelloKey);
  EXPECT_EQ(blobs_->size(kHelloKey), std::nullopt);
}

TEST_P(SharedBlobs, WhatOneIsAboutToNameTheOtherLeaves) {
  put("hello");
  const std::vector<std::string> keys = {kHelloKey};
  EXPECT_EQ(other_->sweep(in(-kAWhile), nothing).quarantined, 0U);
  EXPECT_EQ(other_->erase_unnamed(keys, in(-kAWhile), nothing), keys);
  EXPECT_EQ(get(kHelloKey), "hello");
  blobs_->mark_named(kHelloKey);
  EXPECT_TRUE(other_->erase_unnamed(keys, in(-kAWhile), nothing).empty());
  EXPECT_EQ(code_thrown_by([&] { engine_->open()->open(kHelloKey); }), ErrorCode::kNotFound);
}

TEST_P(SharedBlobs, WhatIsStoredAgainUnderQuarantineStays) {
  put_named("hello");
  EXPECT_EQ(other_->sweep(in(kAWhile), nothing).quarantined, 1U);
  put("hello");
  EXPECT_EQ(other_->sweep(in(-kAWhile), nothing).quarantined, 0U);
  other_->empty_quarantine(at(kAWhile), nothing);
  EXPECT_EQ(test::get(*engine_->open(), kHelloKey), "hello");
}

TEST_P(SharedBlobs, TheLimitKnowsWhatOthersHaveStoredAfterASweep) {
  put_named("hello");
  const auto named = [](const std::string& /*key*/) { return true; };
  other_->sweep(in(-kAWhile), named);
  EXPECT_EQ(other_->bytes(), 5U);
}

// Two sweepers that nothing stops, and a writer that names what it has stored a while later:
// whatever was named is there.
TEST_P(SharedBlobs, TwoSweepersAndASlowWriterLoseNothing) {
  std::atomic<const char*> named = "";  // the one that a record names
  std::atomic<bool> is_over = false;
  constexpr int kLeastRounds = 6;
  const std::vector<std::string> keys = {kHelloKey};
  const auto names = [&](const std::string& key) { return key == named.load(); };
  const auto sweep = [&](BlobStore& blobs) {
    while (!is_over) {
      blobs.erase_unnamed(keys, in(-kAWhile), names);
      blobs.sweep(in(-kAWhile), names);
      blobs.empty_quarantine(at(kAWhile), names);
    }
  };
  const auto third = engine_->open();
  {
    const std::jthread one([&] { sweep(*blobs_); });
    const std::jthread two([&] { sweep(*other_); });
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1500);
    int rounds = 0;
    for (; rounds < kLeastRounds || std::chrono::steady_clock::now() < end; ++rounds) {
      test::put(*third, "hello");
      std::this_thread::sleep_for(std::chrono::milliseconds(rounds % 7));
      named = kHelloKey;
      third->mark_named(kHelloKey);
      if (third->size(kHelloKey) != 5U) ADD_FAILURE() << "lost in round " << rounds;
      named = "";  // and is garbage again
    }
    is_over = true;
  }
}

INSTANTIATE_TEST_SUITE_P(Every, SharedBlobs, testing::ValuesIn([] {
                           std::vector<NamedBlobEngine> engines = test::all_blob_engines();
                           std::erase_if(engines,
                                         [](const auto& engine) { return !engine.is_shared; });
                           return engines;
                         }()),
                         test::name_of_blobs);

}  // namespace
}  // namespace isomesh::store
