#include "base/held_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh {
namespace {

namespace fs = std::filesystem;

// Another user while it exists, if the test has the right to change to one.
class AsNobody {
 public:
  AsNobody() {
    constexpr uid_t kNobody = 65534;
    EXPECT_EQ(::seteuid(user_ == 0 ? kNobody : user_), 0);
  }
  ~AsNobody() { EXPECT_EQ(::seteuid(user_), 0); }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;

 private:
  const uid_t user_ = ::geteuid();
};

class HeldFolderTest : public testing::Test {
 protected:
  HeldFolderTest() { fs::create_directory(place()); }

  fs::path place() const { return parent_ / "place"; }
  fs::path away() const { return parent_ / "away"; }

  test::TemporaryFolder parent_;
};

TEST_F(HeldFolderTest, ThatIsMissingIsRefused) {
  EXPECT_EQ(test::code_thrown_by([&] { HeldFolder folder(parent_ / "absent"); }),
            ErrorCode::kNotFound);
}

TEST_F(HeldFolderTest, PathsLeadIntoItAndNotIntoWhatTakesItsPlace) {
  const HeldFolder folder(place());
  test::write_file(folder.path() / "before", "1");
  fs::rename(place(), away());
  fs::create_directory(place());
  test::write_file(folder.path() / "after", "2");
  EXPECT_EQ(test::read_file(folder.path() / "before"), "1");
  EXPECT_EQ(test::read_file(away() / "after"), "2");
  EXPECT_TRUE(fs::is_empty(place()));
}

TEST_F(HeldFolderTest, IsAtItsPlaceUnlessItOrAnotherSaysOtherwise) {
  const HeldFolder folder(place());
  EXPECT_TRUE(folder.is_at_place());
  fs::rename(place(), away());
  EXPECT_FALSE(folder.is_at_place());
  fs::create_directory(place());
  EXPECT_FALSE(folder.is_at_place());
  fs::remove(place());
  fs::create_directory_symlink(away(), place());
  EXPECT_TRUE(folder.is_at_place()) << "the place still leads to it";
}

TEST_F(HeldFolderTest, IsNotAtItsPlaceWithoutTheRightToWrite) {
  fs::permissions(parent_.path(), fs::perms::all);
  fs::permissions(place(), fs::perms::all);
  const HeldFolder folder(place());
  {
    const AsNobody nobody;
    EXPECT_TRUE(folder.is_at_place());
  }
  fs::permissions(place(), fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read |
                               fs::perms::others_exec);
  {
    const AsNobody nobody;
    EXPECT_FALSE(folder.is_at_place());
  }
  fs::permissions(place(), fs::perms::all);
}

TEST_F(HeldFolderTest, AnotherProcessGetsItsPresentName) {
  const HeldFolder folder(place());
  EXPECT_EQ(for_other_process(folder.path()), fs::canonical(place()));
  EXPECT_EQ(for_other_process(folder.path() / "a/b"), fs::canonical(place()) / "a/b");
  fs::rename(place(), away());
  EXPECT_EQ(for_other_process(folder.path() / "a"), fs::canonical(away()) / "a");
  EXPECT_EQ(for_other_process("/some/where"), "/some/where");
  EXPECT_EQ(for_other_process(""), "");
}

}  // namespace
}  // namespace isomesh
