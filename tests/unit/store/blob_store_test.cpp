#include "server/store/blob_store.h"

#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;

// Of "hello".
constexpr const char* kHello = "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824";

class BlobStoreTest : public testing::Test {
 protected:
  Blob put(std::string_view text) {
    BlobStore::Writer writer(blobs_);
    writer.write(as_span(text));
    return writer.commit();
  }

  std::string get(const std::string& key) {
    const File file = blobs_.open(key);
    std::string text(file.size(), '\0');
    file.read_at(0, std::as_writable_bytes(std::span(text)));
    return text;
  }

  std::size_t blob_files() { return test::files_below(data_.blobs()).size(); }
  std::size_t scratch_files() { return test::files_below(data_.scratch()).size(); }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  BlobStore blobs_{data_};
};

TEST_F(BlobStoreTest, ABlobIsNamedByItsBytes) {
  const Blob blob = put("hello");
  EXPECT_EQ(blob.key, kHello);
  EXPECT_EQ(blob.bytes, 5U);
  EXPECT_EQ(get(kHello), "hello");
  EXPECT_EQ(test::read_file(blobs_.path_of(kHello)), "hello");
}

TEST_F(BlobStoreTest, IsThereOnlyAfterItsCommit) {
  BlobStore::Writer writer(blobs_);
  writer.write(as_span("hel"));
  writer.write(as_span("lo"));
  EXPECT_EQ(blob_files(), 0U);
  EXPECT_EQ(code_thrown_by([&] { blobs_.open(kHello); }), ErrorCode::kNotFound);
  EXPECT_EQ(writer.commit().key, kHello);
  EXPECT_EQ(get(kHello), "hello");
}

TEST_F(BlobStoreTest, AWriterThatIsGivenUpLeavesNothing) {
  {
    BlobStore::Writer writer(blobs_);
    writer.write(as_span("hello"));
    EXPECT_EQ(scratch_files(), 1U);
  }
  EXPECT_EQ(scratch_files(), 0U);
  EXPECT_EQ(blob_files(), 0U);
}

TEST_F(BlobStoreTest, AWriterThatCommitsLeavesTheBlobOnly) {
  put("hello");
  EXPECT_EQ(scratch_files(), 0U);
  EXPECT_EQ(blob_files(), 1U);
}

TEST_F(BlobStoreTest, TheSameBytesAreOneBlob) {
  EXPECT_EQ(put("hello").key, put("hello").key);
  EXPECT_EQ(blob_files(), 1U);
  EXPECT_NE(put("hallo").key, kHello);
  EXPECT_EQ(blob_files(), 2U);
}

TEST_F(BlobStoreTest, AnEmptyBlobIsABlob) {
  const Blob blob = put("");
  EXPECT_EQ(blob.bytes, 0U);
  EXPECT_EQ(get(blob.key), "");
}

TEST_F(BlobStoreTest, WritersDoNotMeet) {
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([this, thread] {
      for (int n = 0; n < 20; ++n) put("common");
      for (int n = 0; n < 20; ++n) put(std::to_string(thread * 100 + n));
    });
  }
  threads.clear();
  EXPECT_EQ(blob_files(), 1U + 4 * 20);
  EXPECT_EQ(scratch_files(), 0U);
}

TEST_F(BlobStoreTest, AdoptsAFinishedFileByMovingIt) {
  const std::string text(3 << 20, 'x');
  test::write_file(data_.scratch() / "made", text);
  const Blob blob = digest_of(data_.scratch() / "made");
  blobs_.adopt(data_.scratch() / "made", blob);
  EXPECT_EQ(blob.bytes, text.size());
  EXPECT_EQ(blob.key, put(text).key);
  EXPECT_FALSE(std::filesystem::exists(data_.scratch() / "made"));
  EXPECT_TRUE(get(blob.key) == text);
}

TEST_F(BlobStoreTest, AdoptingWhatIsNotThereIsRefused) {
  EXPECT_EQ(code_thrown_by([&] { digest_of(data_.scratch() / "absent"); }), ErrorCode::kNotFound);
}

TEST_F(BlobStoreTest, ErasesABlobAndNothingElse) {
  put("hello");
  const std::string other = put("other").key;
  blobs_.erase(kHello);
  EXPECT_EQ(code_thrown_by([&] { blobs_.open(kHello); }), ErrorCode::kNotFound);
  EXPECT_EQ(get(other), "other");
  blobs_.erase(kHello);
  EXPECT_EQ(blob_files(), 1U);
}

TEST_F(BlobStoreTest, AnOpenBlobOutlivesItsErasing) {
  put("hello");
  const File file = blobs_.open(kHello);
  blobs_.erase(kHello);
  std::string text(5, '\0');
  EXPECT_EQ(file.read_at(0, std::as_writable_bytes(std::span(text))), 5U);
  EXPECT_EQ(text, "hello");
}

TEST_F(BlobStoreTest, SweepsWhatIsNotKept) {
  const std::string other = put("other").key;
  put("hello");
  put("more");
  std::set<std::string> asked;
  blobs_.sweep([&](const std::string& key) {
    asked.insert(key);
    return key == kHello;
  });
  EXPECT_EQ(asked.size(), 3U);
  EXPECT_EQ(blob_files(), 1U);
  EXPECT_EQ(get(kHello), "hello");
}

TEST_F(BlobStoreTest, SweepsAnEmptyStore) {
  blobs_.sweep([](const std::string&) { return false; });
  EXPECT_EQ(blob_files(), 0U);
}

}  // namespace
}  // namespace isomesh::store
