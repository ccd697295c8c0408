#include <functional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.h"
#include "server/store/file.h"
#include "server/store/files/blob_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/stores.h"
#include "tests/unit/store/power_cut.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;

// The digest of "hello".
constexpr const char* kHello = "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824";

// Tests specific to the file store; conformance_blobs_test.cpp has those of every blob store.
class FileBlobStoreTest : public testing::Test {
 protected:
  Blob put(std::string_view text) { return test::put(blobs_, text); }
  std::string get(const std::string& key) { return test::get(blobs_, key); }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  FileBlobStore blobs_{data_};
};

// Whoever made its folder had not come to sync it.
TEST_F(FileBlobStoreTest, ABlobOutlivesAPowerCutInAFolderThatWasThere) {
  const test::TemporaryFolder outer;
  const test::PowerCut power(outer.path());
  const DataFolder data(outer / "data");
  sync_folder(outer.path());
  FileBlobStore blobs(data);
  std::filesystem::create_directory(blobs.path_of(kHello).parent_path());
  test::put(blobs, "hello");
  power.leave(folder_ / "left");
  EXPECT_EQ(test::read_file(folder_ / "left/data/blobs/2c" / kHello), "hello");
}

TEST_F(FileBlobStoreTest, AdoptingWhatIsNotThereIsRefused) {
  EXPECT_EQ(code_thrown_by([&] { digest_of(data_.scratch() / "absent"); }), ErrorCode::kNotFound);
}

// A touched file is read again even when size and time of writing are as before.
TEST_F(FileBlobStoreTest, IsNotDeceivedByAnOldTime) {
  put("hello");
  EXPECT_TRUE(blobs_.is_intact(kHello, {}));
  const auto written = std::filesystem::last_write_time(blobs_.path_of(kHello));
  test::write_file(blobs_.path_of(kHello), "hallo");
  std::filesystem::last_write_time(blobs_.path_of(kHello), written);
  EXPECT_FALSE(blobs_.is_intact(kHello, {}));
}

TEST_F(FileBlobStoreTest, ACheckEndsWhenItIsStopped) {
  put("hello");
  std::stop_source stop;
  stop.request_stop();
  FileBlobStore next(data_);  // which has not hashed it while it was written
  EXPECT_EQ(code_thrown_by([&] { next.is_intact(kHello, stop.get_token()); }),
            ErrorCode::kCancelled);
}

// A check that is stopped before it begins succeeds when it has nothing to read.
TEST_F(FileBlobStoreTest, WhatWasHashedToBeAdoptedIsNotReadAgain) {
  std::stop_source stopped;
  stopped.request_stop();
  test::write_file(data_.scratch() / "made", "hello");
  blobs_.adopt(data_.scratch() / "made", digest_of(data_.scratch() / "made"), "", {});
  EXPECT_TRUE(blobs_.is_intact(kHello, stopped.get_token()));
  test::write_file(blobs_.path_of(kHello), "hallo");
  EXPECT_EQ(code_thrown_by([&] { blobs_.is_intact(kHello, stopped.get_token()); }),
            ErrorCode::kCancelled);
  EXPECT_FALSE(blobs_.is_intact(kHello, {}));
}

// The new content has the same size, and it may have the same modification time.
TEST_F(FileBlobStoreTest, WhatIsChangedRightAfterItsAdoptionIsReadAgain) {
  for (int n = 0; n < 50; ++n) {
    const std::string text = std::to_string(1000 + n);
    test::write_file(data_.scratch() / "made", text);
    const Blob blob = digest_of(data_.scratch() / "made");
    blobs_.adopt(data_.scratch() / "made", blob, "", {});
    test::write_file(blobs_.path_of(blob.key), "more");
    EXPECT_FALSE(blobs_.is_intact(blob.key, {}));
  }
}

// True if this process has the file open.
bool is_open(const std::filesystem::path& file) {
  for (const auto& descriptor : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code closed_meanwhile;
    if (std::filesystem::read_symlink(descriptor, closed_meanwhile) == file) return true;
  }
  return false;
}

// Reading takes longer than anybody waits: the file is a hole of a terabyte.
TEST_F(FileBlobStoreTest, WaitingForTheCheckOfAnotherCanBeStopped) {
  const std::string key = put("hello").key;
  const std::filesystem::path file = blobs_.path_of(key);
  std::filesystem::resize_file(file, std::uintmax_t{1} << 40);
  std::jthread another([&](const std::stop_token& stop) {
    EXPECT_EQ(code_thrown_by([&] { blobs_.is_intact(key, stop); }), ErrorCode::kCancelled);
  });
  ASSERT_TRUE(test::eventually([&] { return is_open(file); }));
  std::atomic<bool> has_ended = false;
  std::jthread waiting([&](const std::stop_token& stop) {
    EXPECT_EQ(code_thrown_by([&] { blobs_.is_intact(key, stop); }), ErrorCode::kCancelled);
    has_ended = true;
  });
  waiting.request_stop();
  EXPECT_TRUE(test::eventually([&] { return has_ended.load(); }, std::chrono::seconds(60)));
  another.request_stop();
}

class Sweeping : public FileBlobStoreTest {
 protected:
  static bool nothing(const std::string& /*key*/) { return false; }

  static Steady in(std::chrono::seconds time) { return Steady::clock::now() + time; }
};

// A blob that was just stored is about to be named, however old its file looks.
TEST_F(Sweeping, LeavesWhatWasStoredSince) {
  put("hello");
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(48);
  std::filesystem::last_write_time(blobs_.path_of(kHello), long_ago);
  const std::vector<std::string> keys = {kHello};
  EXPECT_EQ(blobs_.sweep(in(std::chrono::hours(-1)), nothing).quarantined, 0U);
  EXPECT_EQ(blobs_.erase_unnamed(keys, in(std::chrono::hours(-1)), nothing), keys);
  EXPECT_EQ(get(kHello), "hello");
}

// Nobody of this process is about to name it.
TEST_F(Sweeping, WhatAnEarlierProcessLeftIsNotYoung) {
  put("hello");
  FileBlobStore next(data_);
  EXPECT_EQ(next.sweep(in(std::chrono::hours(-1)), nothing).quarantined, 1U);
}

// A folder that several daemons share.
class SharedFolder : public testing::Test {
 protected:
  SharedFolder() { std::filesystem::create_directory(folder_ / "shared"); }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
};

// Otherwise samples deleted while the data folder is away would stay until the next start.
TEST_F(SharedFolder, IsNotNeededToEraseWhatTheDataFolderHolds) {
  FileBlobStore blobs(data_);
  const std::string key = test::put(blobs, "hello").key;
  std::filesystem::rename(folder_ / "data", folder_ / "away");
  blobs.erase(key);
  std::filesystem::rename(folder_ / "away", folder_ / "data");
  EXPECT_FALSE(blobs.size(key));
}

// A mount that is missing is not to be filled in its place.
TEST_F(SharedFolder, IsNotMade) {
  EXPECT_EQ(code_thrown_by([&] { shared_blob_folders(folder_ / "absent"); }),
            ErrorCode::kUnavailable);
}

// A folder that is not mounted for a while is no damage, and nothing is stored in its place.
class MovedAway : public SharedFolder, public testing::WithParamInterface<const char*> {
 protected:
  std::filesystem::path shared() const { return folder_ / "shared"; }

  void move_away() {
    std::filesystem::rename(shared(), folder_ / "elsewhere");
    const std::string instead = GetParam();
    if (instead == "Empty") std::filesystem::create_directory(shared());
    if (instead == "Another") {
      std::filesystem::create_directory(shared());
      FileBlobStore(shared_blob_folders(shared()), data_.reserve()).set_mark("another 1\n");
      const DataFolder of_another_daemon(shared());
    }
  }

  void check_is_unavailable_until_back(FileBlobStore& blobs);

  void move_back() {
    std::filesystem::remove_all(shared());
    std::filesystem::rename(folder_ / "elsewhere", shared());
  }

  std::string store_hello(FileBlobStore& blobs) {
    std::string key = test::put(blobs, "hello").key;
    blobs.mark_named(key);
    return key;
  }
};

INSTANTIATE_TEST_SUITE_P(Instead, MovedAway, testing::Values("Nothing", "Empty", "Another"),
                         [](const auto& instead) { return std::string(instead.param); });

TEST_P(MovedAway, IsUnavailableUntilItIsBack) {
  FileBlobStore blobs(shared_blob_folders(shared()), data_.reserve());
  check_is_unavailable_until_back(blobs);
}

TEST_P(MovedAway, ADataFolderIsUnavailableUntilItIsBack) {
  const DataFolder data(shared());
  FileBlobStore blobs(data);
  check_is_unavailable_until_back(blobs);
}

void MovedAway::check_is_unavailable_until_back(FileBlobStore& blobs) {
  blobs.set_mark("ours 1\n");
  store_hello(blobs);
  const auto begun = blobs.begin("");
  begun->write(as_span("begun"));
  const auto nothing = [](const std::string& /*key*/) { return false; };
  const auto later = Steady::clock::now() + std::chrono::hours(1);
  const std::string key = kHello;
  std::vector<std::function<void()>> all = {[&] { blobs.open(key); },
                                            [&] { blobs.local(key); },
                                            [&] { blobs.size(key); },
                                            [&] { blobs.is_intact(key, {}); },
                                            [&] { is_there_and_intact(blobs, key, {}); },
                                            [&] { store_hello(blobs); },
                                            [&] { begun->commit(); },
                                            [&] {
                                              blobs.adopt(folder_ / "file", {kHello, 5}, "", {});
                                            },
                                            [&] { blobs.set_mark("ours 2\n"); }};
  if (blobs.is_shared()) {  // a data folder is held, so what is to be erased is found in it
    all.emplace_back([&] { blobs.erase(key); });
    all.emplace_back([&] { blobs.erase_unnamed(std::span(&key, 1), later, nothing); });
  }
  test::write_file(folder_ / "file", "hello");
  start_log(LogFormat::kText, LogLevel::kInfo);
  testing::internal::CaptureStderr();
  move_away();
  const auto files = [this] {
    return std::filesystem::exists(shared()) ? test::files_below(shared())
                                             : std::vector<std::string>();
  };
  const auto before = files();
  for (std::size_t n = 0; n < all.size(); ++n) {
    EXPECT_EQ(code_thrown_by(all[n]), ErrorCode::kUnavailable) << n;
  }
  EXPECT_FALSE(blobs.responds());
  EXPECT_EQ(files(), before);
  move_back();
  EXPECT_EQ(test::read_file(folder_ / "file"), "hello");
  EXPECT_EQ(blobs.open(key)->size(), 5U);
  EXPECT_TRUE(blobs.is_intact(key, {}));
  EXPECT_EQ(store_hello(blobs), key);
  EXPECT_EQ(code_thrown_by([&] { blobs.local(std::string(64, '0')); }), ErrorCode::kNotFound);
  const std::string log = testing::internal::GetCapturedStderr();
  start_log(LogFormat::kText, LogLevel::kOff);
  const std::string name =
      blobs.is_shared() ? "the storage of volumes and meshes" : "the data folder";
  EXPECT_THAT(log, testing::MatchesRegex("[^\n]* error [^\n]*" + name + " is missing[^\n]*\n" +
                                         "[^\n]* info [^\n]*" + name + " is back[^\n]*\n"));
}

TEST_F(SharedFolder, WhatADaemonThatDiedHeldIsNotHeldForEver) {
  FileBlobStore blobs(shared_blob_folders(folder_ / "shared"), data_.reserve());
  test::put(blobs, "hello");
  blobs.mark_named(kHello);
  const auto hold = folder_ / ("shared/holds/" + std::string(kHello) + ".0123");
  test::write_file(hold, "");
  const auto nothing = [](const std::string& /*key*/) { return false; };
  const auto an_hour_ago = Steady::clock::now() - std::chrono::hours(1);
  const auto age = [&](std::chrono::hours by) {
    std::filesystem::last_write_time(hold, std::filesystem::file_time_type::clock::now() - by);
  };
  EXPECT_EQ(blobs.sweep(an_hour_ago, nothing).quarantined, 0U);
  age(std::chrono::hours(2));
  EXPECT_EQ(blobs.sweep(an_hour_ago, nothing).quarantined, 1U);
  EXPECT_TRUE(std::filesystem::exists(hold));
  age(std::chrono::hours(25));
  blobs.sweep(an_hour_ago, nothing);
  EXPECT_FALSE(std::filesystem::exists(hold));
}

}  // namespace
}  // namespace isomesh::store
