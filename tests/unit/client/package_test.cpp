#include "client/isomesh/package.h"

#include <algorithm>

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

std::vector<std::string> names_of(const fs::path& path) {
  std::vector<std::string> names;
  for (const PackedFile& file : files_of_upload(path)) names.push_back(file.name);
  return names;
}

std::string read_all(const UploadBody& body, std::size_t piece_bytes) {
  std::string text(static_cast<std::size_t>(body.size()), '?');
  for (std::size_t at = 0; at < text.size(); at += piece_bytes) {
    const std::span<char> rest = std::span(text).subspan(at);
    body.read(at, rest.first(std::min(piece_bytes, rest.size())));
  }
  return text;
}

// The entries that libarchive finds in it, in order.
std::vector<std::pair<std::string, std::string>> members_of(const std::string& tar) {
  std::vector<std::pair<std::string, std::string>> members;
  archive* reader = ::archive_read_new();
  ::archive_read_support_format_tar(reader);
  EXPECT_EQ(::archive_read_open_memory(reader, tar.data(), tar.size()), ARCHIVE_OK);
  archive_entry* entry = nullptr;
  int status = ARCHIVE_OK;
  // A warning is a name that the test's locale cannot spell.
  while ((status = ::archive_read_next_header(reader, &entry)) == ARCHIVE_OK ||
         status == ARCHIVE_WARN) {
    std::string bytes(static_cast<std::size_t>(::archive_entry_size(entry)), '\0');
    EXPECT_EQ(::archive_read_data(reader, bytes.data(), bytes.size()),
              static_cast<la_ssize_t>(bytes.size()));
    // The first is null where the test's locale cannot spell the name; the second is its bytes.
    const char* name = ::archive_entry_pathname_utf8(entry);
    members.emplace_back(name != nullptr ? name : ::archive_entry_pathname(entry), bytes);
  }
  EXPECT_EQ(status, ARCHIVE_EOF);
  ::archive_read_free(reader);
  return members;
}

TEST(UploadBody, OfAFileIsTheFile) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "head.nii", "volume");
  EXPECT_EQ(read_all(UploadBody(folder / "head.nii"), 4), "volume");
  test::write_file(folder / "empty", "");
  EXPECT_EQ(UploadBody(folder / "empty").size(), 0U);
}

// The server skips what is no part of a volume.
TEST(UploadBody, OfAFolderIsATarOfAllItsFiles) {
  const test::TemporaryFolder folder;
  const fs::path root = folder / "series";
  fs::create_directories(root / "b" / ".hidden");
  const std::string long_name(150, 'n');
  test::write_file(root / "z.dcm", std::string(1000, 'z'));
  test::write_file(root / "a.dcm", std::string(512, 'a'));
  test::write_file(root / "b" / "\xc3\xa4.dcm", "b");
  test::write_file(root / "b" / long_name, "n");
  test::write_file(root / ".DS_Store", "system");
  test::write_file(root / "b" / ".hidden" / "c", "hidden");
  test::write_file(root / "notes.txt", "text");
  test::write_file(root / "old.stl", "");
  const std::string tar = read_all(UploadBody(root), 100'000);
  EXPECT_EQ(tar.size() % 512, 0U);
  EXPECT_THAT(members_of(tar),
              ElementsAre(Pair(".DS_Store", "system"), Pair("a.dcm", std::string(512, 'a')),
                          Pair("b/.hidden/c", "hidden"), Pair("b/" + long_name, "n"),
                          Pair("b/\xc3\xa4.dcm", "b"), Pair("notes.txt", "text"),
                          Pair("old.stl", ""), Pair("z.dcm", std::string(1000, 'z'))));
  for (const std::size_t piece : {1U, 7U, 512U, 513U}) {
    EXPECT_EQ(read_all(UploadBody(root), piece), tar) << piece;
  }
}

// As DataLad has them: the named folder has only links, to objects outside of it.
TEST(UploadBody, LinksInAFolderAreFollowed) {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / ".git" / "objects" / "deep");
  fs::create_directories(folder / "sub");
  test::write_file(folder / ".git" / "objects" / "X1", "one");
  test::write_file(folder / ".git" / "objects" / "deep" / "X2", "two");
  fs::create_symlink("../.git/objects/X1", folder / "sub" / "a.nii");
  fs::create_directory_symlink("../.git/objects/deep", folder / "sub" / "more");
  const auto files = ElementsAre(Pair("a.nii", "one"), Pair("more/X2", "two"));
  EXPECT_THAT(members_of(read_all(UploadBody(folder / "sub"), 4096)), files);
  EXPECT_THAT(names_of(folder / ""), ElementsAre("sub/a.nii", "sub/more/X2"));
}

// As Emacs marks a file that is open.
TEST(UploadBody, HiddenLinksToNothingAreSkipped) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "a.nii", "one");
  fs::create_symlink("someone@host.1234:5678", folder / ".#notes.txt");
  EXPECT_THAT(names_of(folder / ""), ElementsAre("a.nii"));
}

TEST(UploadBody, LinksToNothingAndLoopsAreNamed) {
  const test::TemporaryFolder folder;
  const auto fault = [&](const char* name) {
    return std::string(test::error_of([&] { files_of_upload(folder / name); }).what());
  };
  for (const char* name : {"broken", "loop", "self"}) {
    fs::create_directories(folder / name / "in");
    test::write_file(folder / name / "a.nii", "one");
  }
  fs::create_symlink("absent", folder / "broken" / "in" / "gone.nii");
  fs::create_directory_symlink("..", folder / "loop" / "in" / "up");
  fs::create_symlink("round", folder / "self" / "round");
  EXPECT_THAT(fault("broken"), HasSubstr("in/gone.nii: is a link to a file that is not there"));
  EXPECT_THAT(fault("loop"), HasSubstr("in/up: leads back to a folder"));
  EXPECT_THAT(fault("self"), HasSubstr("self/round: is a link"));
}

// Each folder has two links to the next.
TEST(UploadBody, LinksThatMultiplyFoldersAreBounded) {
  const test::TemporaryFolder folder;
  for (int at = 0; at < 30; ++at) {
    const fs::path one = folder / std::to_string(at);
    fs::create_directories(one);
    for (const char* name : {"a", "b"}) {
      fs::create_directory_symlink(fs::path("..") / std::to_string(at + 1), one / name);
    }
  }
  fs::create_directories(folder / "30");
  const Error error = test::error_of([&] { files_of_upload(folder / "0"); });
  EXPECT_THAT(error.what(), HasSubstr("more than 1000 links to folders"));
}

TEST(UploadBody, OfAnEmptyFolderIsRefused) {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "empty" / "more");
  const Error error = test::error_of([&] { UploadBody body(folder / "empty"); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(error.what(), HasSubstr("contains no files"));
}

TEST(UploadBody, OfNoPathsIsRefused) {
  const Error error =
      test::error_of([] { Client({.server = "http://127.0.0.1:1"}).upload_all({}); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(error.what(), HasSubstr("no files"));
}

TEST(UploadBody, OfAHeaderTakesItsDataAlong) {
  const test::TemporaryFolder folder;
  for (const char* name : {"head.raw", "1.raw", "2.raw", "a b.raw"})
    test::write_file(folder / name, "x");
  const auto names = [&](const std::string& name, const std::string& text) {
    test::write_file(folder / name, text);
    return names_of(folder / name);
  };
  EXPECT_THAT(names("h.mhd", "NDims = 3\nElementDataFile = head.raw\n"),
              ElementsAre("h.mhd", "head.raw"));
  EXPECT_THAT(names("h.mhd", "ElementDataFile = a b.raw\r\n"), ElementsAre("h.mhd", "a b.raw"));
  EXPECT_THAT(names("h.mhd", "ElementDataFile = LIST\n1.raw\n2.raw\n"),
              ElementsAre("h.mhd", "1.raw", "2.raw"));
  EXPECT_THAT(names("h.MHD", "ElementDataFile = LOCAL\n1.raw\n"), ElementsAre("h.MHD"));
  EXPECT_THAT(names("h.nhdr", "NRRD0004\nData File: head.raw\n"),
              ElementsAre("h.nhdr", "head.raw"));
  EXPECT_THAT(names("h.nhdr", "NRRD0004\ndatafile: LIST\n1.raw\n2.raw"),
              ElementsAre("h.nhdr", "1.raw", "2.raw"));
  EXPECT_THAT(names("h.mhd", "ElementDataFile = %d.raw 1 2 1\n"),
              ElementsAre("h.mhd", "1.raw", "2.raw"));
  EXPECT_THAT(names("h.nhdr", "NRRD0004\ndata file: 1%02d.raw 1 2 1\n"), ElementsAre("h.nhdr"));
  // The server tells what is wrong with these.
  EXPECT_THAT(names("h.mhd", "ElementDataFile = ../head.raw\n"), ElementsAre("h.mhd"));
  EXPECT_THAT(names("h.mhd", "ElementDataFile = s%d.raw 1 2 1\n"), ElementsAre("h.mhd"));
  EXPECT_THAT(names("h.mhd", "ElementDataFile = 1% 1 2 1\n"), ElementsAre("h.mhd"));
}

TEST(UploadBody, OfAPairTakesBothFilesAlong) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.hdr", "a.img", "a.img.gz", "b.hdr.gz", "b.img.gz", "c.hdr.gz",
                           "s+orig.HEAD", "s+orig.BRIK.gz"}) {
    test::write_file(folder / name, "x");
  }
  EXPECT_THAT(names_of(folder / "a.hdr"), ElementsAre("a.hdr", "a.img"));
  EXPECT_THAT(names_of(folder / "a.img"), ElementsAre("a.hdr", "a.img"));
  EXPECT_THAT(names_of(folder / "a.img.gz"), ElementsAre("a.hdr", "a.img.gz"));
  EXPECT_THAT(names_of(folder / "b.hdr.gz"), ElementsAre("b.hdr.gz", "b.img.gz"));
  EXPECT_THAT(names_of(folder / "b.img.gz"), ElementsAre("b.hdr.gz", "b.img.gz"));
  EXPECT_THAT(names_of(folder / "c.hdr.gz"), ElementsAre("c.hdr.gz"));
  EXPECT_THAT(names_of(folder / "s+orig.BRIK.gz"), ElementsAre("s+orig.HEAD", "s+orig.BRIK.gz"));
}

TEST(UploadBody, DataThatIsNotThereIsNamed) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "h.mhd", "ElementDataFile = absent.raw\n");
  const Error error = test::error_of([&] { UploadBody body(folder / "h.mhd"); });
  EXPECT_THAT(error.what(), HasSubstr("absent.raw"));
}

TEST(UploadBody, AFileThatWasCutMeanwhileIsNamed) {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "d");
  test::write_file(folder / "d" / "a", std::string(1000, 'a'));
  const UploadBody body(folder / "d");
  test::write_file(folder / "d" / "a", "short");
  const Error error = test::error_of([&] { read_all(body, 4096); });
  EXPECT_THAT(error.what(), HasSubstr("shorter"));
}

}  // namespace
}  // namespace isomesh
