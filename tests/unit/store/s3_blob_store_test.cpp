// Tests specific to blobs in S3: a failing peer, local copies, and state that is kept in objects.
#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include "server/store/s3/blob_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/s3_peer.h"
#include "tests/support/stores.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;
using test::error_of;
using test::S3Peer;
using test::thrown_by;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class S3Blobs : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string missing = S3Peer::missing(); !missing.empty()) {
      GTEST_SKIP() << missing;
    }
    peer().reset();
    test::write_file(folder_ / "credentials", S3Peer::credentials());
    options_.client.address = parse_s3_url(peer().url());
    options_.client.credentials = folder_ / "credentials";
    options_.client.patience = std::chrono::seconds(10);
    options_.client.quick = std::chrono::minutes(1);
    options_.client.first_pause = std::chrono::milliseconds(5);
    options_.between_sweeps = std::chrono::milliseconds(0);
    open();
  }

  // As after a start of the daemon.
  void open() {
    blobs_.reset();
    data_.reset();
    data_ = std::make_unique<DataFolder>(folder_ / "data");
    blobs_ = std::make_unique<S3BlobStore>(*data_, options_);
  }

  static S3Peer& peer() {
    static S3Peer only;
    return only;
  }

  std::string put(std::string_view text) {
    std::string key = test::put(*blobs_, text).key;
    blobs_->mark_named(key);
    return key;
  }

  // The error of storing the text if that is stopped once the peer has a PUT with `part`.
  std::optional<ErrorCode> code_thrown_by_stopping(std::string_view text, const std::string& part) {
    std::stop_source stop;
    const std::jthread stopping([&] {
      EXPECT_TRUE(test::eventually([&] { return peer().count("PUT", part) > 0; }));
      stop.request_stop();
    });
    const auto writer = blobs_->begin("");
    writer->write(as_span(text));
    return code_thrown_by([&] { writer->commit(stop.get_token()); });
  }

  // One of which there is no copy here.
  std::string put_elsewhere(std::string_view text) {
    std::string key = put(text);
    std::filesystem::remove(copy_of(key));
    return key;
  }

  std::filesystem::path copy_of(const std::string& key) {
    return folder_ / ("data/cache/blobs/" + key.substr(0, 2) + '/' + key);
  }

  std::string get(const std::string& key) { return test::get(*blobs_, key); }

  static bool nothing(const std::string& /*key*/) { return false; }

  std::string text_of(std::size_t bytes) {
    std::string text;
    while (text.size() < bytes) text += std::to_string(text.size()) + ' ';
    text.resize(bytes);
    return text;
  }

  test::TemporaryFolder folder_;
  S3Options options_;
  std::unique_ptr<DataFolder> data_;
  std::unique_ptr<S3BlobStore> blobs_;
};

// Such as a token that has expired, and is replaced in the file meanwhile.
TEST_F(S3Blobs, WhatFailsForAWhileIsAskedAgain) {
  for (const char* what : {"status-500", "status-503", "status-400-ExpiredToken",
                           "status-400-RequestTimeout", "drop"}) {
    peer().fail(what, 3, "PUT");
    const std::string key = put_elsewhere(what);
    peer().fail(what, 2, "GET", key);
    EXPECT_EQ(get(key), what);
  }
}

TEST_F(S3Blobs, NoRefusalIsTheFaultOfABlob) {
  const std::string key = put_elsewhere("hello");
  for (const int status :
       {301, 302, 307, 400, 401, 403, 404, 405, 410, 411, 412, 418, 431, 451, 501, 505, 511, 599}) {
    const std::string what = "status-" + std::to_string(status);
    peer().fail(what);
    EXPECT_EQ(code_thrown_by([&] { put(what); }), ErrorCode::kUnavailable) << status;
    EXPECT_EQ(code_thrown_by([&] { blobs_->open(key); }), ErrorCode::kUnavailable) << status;
    EXPECT_EQ(code_thrown_by([&] { blobs_->is_intact(key, {}); }), ErrorCode::kUnavailable)
        << status;
    EXPECT_EQ(code_thrown_by([&] { blobs_->sweep({}, {}); }), ErrorCode::kUnavailable) << status;
    peer().recover();
    peer().fail(what, 0, "PUT", "/blobs/");
    EXPECT_EQ(code_thrown_by([&] { put(what); }), ErrorCode::kUnavailable) << status;
    peer().recover();
    EXPECT_EQ(get(put_elsewhere(what)), what) << status;
  }
  EXPECT_EQ(get(key), "hello");
}

TEST_F(S3Blobs, AFullServiceIsOutOfSpace) {
  for (const char* what : {"status-507", "status-507-XMinioStorageFull", "status-403-QuotaExceeded",
                           "status-400-XMinioAdminBucketQuotaExceeded"}) {
    for (const char* part : {"/holds/", "/blobs/"}) {
      peer().fail(what, 0, "PUT", part);
      EXPECT_EQ(code_thrown_by([&] { put("hello"); }), ErrorCode::kOutOfSpace) << what << part;
      peer().recover();
    }
  }
  EXPECT_EQ(get(put("hello")), "hello");
}

// A blob that is not found then must not be taken for damaged.
TEST_F(S3Blobs, ABucketThatIsGoneBetweenTwoRequestsLosesNothing) {
  const std::string key = put_elsewhere("hello");
  peer().fail("status-404", 0, "GET");
  EXPECT_EQ(code_thrown_by([&] { is_there_and_intact(*blobs_, key, {}); }),
            ErrorCode::kUnavailable);
  peer().recover();
  EXPECT_EQ(get(key), "hello");
}

TEST_F(S3Blobs, APeerThatIsDownIsUnavailableAndNothingIsStored) {
  options_.client.patience = std::chrono::milliseconds(500);
  open();
  peer().fail("drop");
  EXPECT_EQ(code_thrown_by([&] { put("hello"); }), ErrorCode::kUnavailable);
  EXPECT_EQ(code_thrown_by([&] { blobs_->mark(); }), ErrorCode::kUnavailable);
  EXPECT_EQ(code_thrown_by([&] { blobs_->sweep({}, {}); }), ErrorCode::kUnavailable);
  EXPECT_FALSE(blobs_->responds());
  peer().recover();
  EXPECT_TRUE(peer().keys().empty());
  EXPECT_EQ(get(put("hello")), "hello");
}

TEST_F(S3Blobs, APeerThatIsSilentIsGivenUp) {
  const std::string key = put_elsewhere("hello");
  options_.client.stall = std::chrono::seconds(1);
  open();
  peer().fail("hang", 1, "GET", key);
  EXPECT_EQ(get(key), "hello");
}

TEST_F(S3Blobs, AnUploadCanBeStopped) {
  peer().fail("hang", 1, "PUT", "/blobs/");
  EXPECT_EQ(code_thrown_by_stopping("hello", "/blobs/"), ErrorCode::kCancelled);
  EXPECT_TRUE(peer().keys().empty());
  EXPECT_EQ(get(put("hello")), "hello");
}

TEST_F(S3Blobs, ADownloadThatIsCutOffGoesOnWhereItWas) {
  const std::string text = text_of(1'000'000);
  const std::string key = put_elsewhere(text);
  peer().fail("cut", 3, "GET", key);
  EXPECT_TRUE(get(key) == text);
  EXPECT_EQ(peer().count("GET", "/blobs/"), 4);
}

TEST_F(S3Blobs, APeerWithoutRangesSendsAllAgain) {
  const std::string text = text_of(1'000'000);
  const std::string key = put_elsewhere(text);
  peer().fail("cut", 1, "GET", key);
  peer().fail("ignore-range", 1, "GET", key);
  EXPECT_TRUE(get(key) == text);
}

TEST_F(S3Blobs, BytesBehindTheEndAreNoneOfIt) {
  const std::string key = put_elsewhere("hello");
  peer().fail("more", 1, "GET", key);
  EXPECT_EQ(get(key), "hello");
}

TEST_F(S3Blobs, OtherBytesThanTheKeysAreReadTwiceAndThenRefused) {
  const std::string key = put_elsewhere("hello");
  peer().fail("flip", 1, "GET", key);
  EXPECT_EQ(get(key), "hello");
  std::filesystem::remove(copy_of(key));
  peer().fail("flip", 0, "GET", key);
  EXPECT_FALSE(blobs_->is_intact(key, {}));
  EXPECT_EQ(code_thrown_by([&] { blobs_->open(key); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { blobs_->local(key); }), ErrorCode::kInternal);
}

// Never a record before its blob.
TEST_F(S3Blobs, APeerThatStoresNothingIsFoundOut) {
  peer().fail("forget", 0, "PUT", "/blobs/");
  EXPECT_EQ(code_thrown_by([&] { put("hello"); }), ErrorCode::kUnavailable);
}

TEST_F(S3Blobs, AnUploadWhoseAnswerIsLostIsNotAnError) {
  peer().fail("late", 1, "PUT", "/blobs/");
  EXPECT_EQ(get(put_elsewhere("hello")), "hello");
}

TEST_F(S3Blobs, WhatIsThereIsNotReplaced) {
  const std::string key = put("hello");
  put("hello");
  EXPECT_EQ(peer().count("PUT", "/blobs/" + key), 2);  // of which the peer refuses one
  EXPECT_EQ(blobs_->bytes(), 5U);
  peer().put("blobs/" + key, "cut");
  put("hello");
  std::filesystem::remove(copy_of(key));
  EXPECT_EQ(get(key), "hello") << "what is there with another size is no blob";
}

TEST_F(S3Blobs, APeerWithoutConditionsIsAskedWithoutThem) {
  peer().forget_conditions();
  EXPECT_EQ(get(put_elsewhere("hello")), "hello");
  EXPECT_EQ(get(put_elsewhere("hello")), "hello");
}

class InParts : public S3Blobs {
 protected:
  InParts() {
    options_.client.multipart_above = 1'000;
    options_.client.part_bytes = 400;
  }
};

TEST_F(InParts, WhatIsLargeIsSentInParts) {
  const std::string text = text_of(1'500);
  const std::string key = put_elsewhere(text);
  EXPECT_EQ(peer().count("PUT", "partNumber="), 4);
  EXPECT_TRUE(get(key) == text);
  put(text);
  EXPECT_EQ(peer().count("PUT", "partNumber="), 4) << "it is there already";
  put_elsewhere(text_of(1'000));
  EXPECT_EQ(peer().count("PUT", "partNumber="), 4) << "that is not large";
}

TEST_F(InParts, APartThatFailsIsSentAgain) {
  peer().fail("status-503", 2, "PUT", "partNumber=3");
  const std::string text = text_of(1'500);
  EXPECT_TRUE(get(put_elsewhere(text)) == text);
}

TEST_F(InParts, AnUploadThatCannotGoOnIsGivenUp) {
  peer().fail("status-403", 0, "PUT", "partNumber=3");
  EXPECT_EQ(code_thrown_by([&] { put(text_of(1'500)); }), ErrorCode::kUnavailable);
  EXPECT_EQ(peer().open_uploads(), 0);
}

TEST_F(InParts, AnUploadCanBeStopped) {
  peer().fail("hang", 1, "PUT", "partNumber=2");
  EXPECT_EQ(code_thrown_by_stopping(text_of(1'500), "partNumber=2"), ErrorCode::kCancelled);
  EXPECT_TRUE(peer().keys().empty());
  EXPECT_EQ(peer().open_uploads(), 0);
}

TEST_F(S3Blobs, AWrongKeyIsRefusedAndNotTold) {
  test::write_file(folder_ / "credentials", S3Peer::credentials(false));
  const Error error = error_of([&] { put("hello"); });
  EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error.what(), Not(HasSubstr("another")));
  EXPECT_FALSE(blobs_->responds());
  test::write_file(folder_ / "credentials", S3Peer::credentials());
  EXPECT_EQ(get(put("hello")), "hello") << "the file is read again";
}

TEST_F(S3Blobs, ALongListComesInPages) {
  peer().list_in_pages_of(3);
  for (int n = 0; n < 10; ++n) put(std::to_string(n));
  const auto later = Steady::clock::now() + std::chrono::hours(1);
  EXPECT_EQ(blobs_->sweep(later, nothing).quarantined, 10U);
  EXPECT_EQ(blobs_->bytes(), 10U);
  EXPECT_EQ(blobs_->empty_quarantine(Time::max(), nothing), 10U);
  EXPECT_TRUE(peer().keys().empty());
}

TEST_F(S3Blobs, ARequestThatMayBeLateKeepsOthersFromStoringIt) {
  const std::string key = put("hello");
  peer().fail("late", 1, "DELETE", "/blobs/");
  EXPECT_TRUE(blobs_->erase_unnamed(std::span(&key, 1), Steady::clock::now(), nothing).empty());
  ASSERT_EQ(peer().keys().size(), 1U);
  EXPECT_THAT(peer().keys().front(), HasSubstr("going/" + key));
  peer().age(peer().keys().front(), std::chrono::minutes(21));
  EXPECT_EQ(get(put("hello")), "hello");
}

// Its copy in the cache is erased, too, while the thread that stores it waits.
TEST_F(S3Blobs, BytesCanBeStoredAgainWhileTheyAreErased) {
  options_.client.patience = std::chrono::seconds(60);
  open();
  const std::string key = put("hello");
  const int listed = peer().count("GET", "going");
  peer().fail("status-503", 0, "DELETE", "/quarantine/");
  std::jthread erasing([&] {
    EXPECT_TRUE(blobs_->erase_unnamed(std::span(&key, 1), Steady::clock::now(), nothing).empty());
  });
  EXPECT_TRUE(test::eventually([&] { return peer().count("DELETE", "/quarantine/") > 0; }));
  std::jthread storing([&] {
    const auto error = thrown_by([&] { put("hello"); });
    EXPECT_FALSE(error) << error->what();
  });
  EXPECT_TRUE(test::eventually([&] { return peer().count("GET", "going") > listed; }));
  peer().recover();
  erasing.join();
  storing.join();
  EXPECT_EQ(get(key), "hello");
}

TEST_F(S3Blobs, WhatADaemonThatDiedHeldIsNotHeldForEver) {
  const std::string key = put("hello");
  peer().put("holds/" + key + "/0123456789abcdef", "");
  const auto an_hour_ago = Steady::clock::now() - std::chrono::hours(1);
  EXPECT_EQ(blobs_->sweep(an_hour_ago, nothing).quarantined, 0U);
  peer().age("holds/" + key + "/0123456789abcdef", std::chrono::hours(2));
  EXPECT_EQ(blobs_->sweep(an_hour_ago, nothing).quarantined, 1U);
  peer().age("holds/" + key + "/0123456789abcdef", std::chrono::hours(24));
  blobs_->sweep(an_hour_ago, nothing);
  EXPECT_THAT(peer().keys(), Not(Contains(HasSubstr("holds/"))));
}

TEST_F(S3Blobs, WhatIsHereIsNotFetched) {
  const std::string key = put("hello");
  EXPECT_EQ(get(key), "hello");
  EXPECT_EQ(test::read_file(blobs_->local(key).path), "hello");
  peer().fail("drop");
  EXPECT_EQ(get(key), "hello");
  peer().recover();
  open();
  EXPECT_EQ(get(key), "hello") << "a copy outlives the daemon";
  EXPECT_EQ(peer().count("GET", "/blobs/"), 0);
}

TEST_F(S3Blobs, ACopyThatADiskHasSpoiltIsFetchedAnew) {
  const std::string key = put("hello");
  test::write_file(copy_of(key), "hallo");
  EXPECT_EQ(get(key), "hello");
  EXPECT_EQ(peer().count("GET", "/blobs/"), 1);
}

class SmallCache : public S3Blobs {
 protected:
  SmallCache() { options_.cache_bytes = 100; }
};

TEST_F(SmallCache, WhatWasNotUsedForLongestGoes) {
  const std::string first = put(std::string(40, '1'));
  const std::string second = put(std::string(40, '2'));
  get(first);
  const std::string third = put(std::string(40, '3'));
  EXPECT_TRUE(std::filesystem::exists(copy_of(first)));
  EXPECT_FALSE(std::filesystem::exists(copy_of(second)));
  EXPECT_EQ(get(second), std::string(40, '2'));
}

TEST_F(SmallCache, WhatIsInUseStays) {
  const std::string first = put(std::string(80, '1'));
  const LocalBlob in_use = blobs_->local(first);
  put(std::string(80, '2'));
  EXPECT_EQ(test::read_file(in_use.path), std::string(80, '1'));
}

TEST_F(SmallCache, WhatIsLargerThanAllOfItCanBeUsed) {
  const std::string key = put(std::string(200, '1'));
  std::filesystem::remove(copy_of(key));
  EXPECT_TRUE(blobs_->is_intact(key, {}));
  EXPECT_EQ(test::read_file(blobs_->local(key).path), std::string(200, '1'));
  EXPECT_EQ(peer().count("GET", "/blobs/"), 1) << "once for both";
  put("another");
  EXPECT_FALSE(std::filesystem::exists(copy_of(key)));
}

TEST_F(S3Blobs, CopiesOfWhatNothingNamesGoWithASweep) {
  const std::string key = put("hello");
  const std::string other = put("other");
  blobs_->sweep({}, [&](const std::string& asked) { return asked == other; });
  EXPECT_FALSE(std::filesystem::exists(copy_of(key)));
  EXPECT_TRUE(std::filesystem::exists(copy_of(other)));
}

TEST_F(S3Blobs, ALinkIsGoodForWhoeverHasIt) {
  const std::string key = put("hello");
  const LinkedAs as = {.name = "mesh 1.drc", .media_type = "application/octet-stream"};
  const std::string link = blobs_->link(key, as).value();
  const auto fetched = [&](const std::string& url) {
    httplib::Client client(peer().endpoint());
    client.set_read_timeout(std::chrono::minutes(1));
    return client.Get(url.substr(peer().endpoint().size()));
  };
  const auto answer = fetched(link);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->body, "hello");
  EXPECT_EQ(answer->get_header_value("Content-Disposition"), "attachment; filename=\"mesh 1.drc\"");
  EXPECT_THAT(link, Not(HasSubstr("secret")));
  std::string changed = link;
  changed.replace(changed.find("mesh"), 4, "mess");
  EXPECT_EQ(fetched(changed)->status, 403);
}

}  // namespace
}  // namespace isomesh::store
