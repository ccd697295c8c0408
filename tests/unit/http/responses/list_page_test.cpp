#include "server/http/responses/list_page.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace isomesh::http {
namespace {

// Jobs with the ids 100000, 100001 and so on, and how many were read at once at most.
class ListPageTest : public testing::Test {
 protected:
  static constexpr std::size_t kFirst = 100'000;

  static std::vector<Job> jobs(std::size_t begin, std::size_t end) {
    std::vector<Job> rows(end - begin);
    for (Job& row : rows) row.id = std::to_string(kFirst + begin++);
    return rows;
  }

  ListPage<Job> page(std::size_t begin, std::size_t limit) {
    const auto read = [this](const std::string& after, std::size_t count) {
      const std::size_t from = after.empty() ? 0 : std::stoul(after) - kFirst + 1;
      const std::size_t rows = std::min(count, count_ - from);
      most_read_ = std::max(most_read_, rows);
      return jobs(from, from + rows);
    };
    const std::string after = begin == 0 ? "" : std::to_string(kFirst + begin - 1);
    return ListPage<Job>({.kind = "jobs",
                          .after = after,
                          .limit = limit,
                          .read = read,
                          .place_of = [](const Job& job) { return job.id; }});
  }

  std::size_t count_ = 350;
  std::size_t most_read_ = 0;
};

TEST_F(ListPageTest, ItsPiecesMakeThePage) {
  for (const std::size_t begin : {0, 1, 150, 249, 250, 251, 349, 350}) {
    for (const std::size_t limit : {1, 99, 100, 101, 200, 349, 350, 1000}) {
      ListPage<Job> list = page(begin, limit);
      std::string text;
      while (const auto piece = list.next()) text += *piece;
      const std::size_t end = std::min(begin + limit, count_);
      const std::string next =
          end < count_ ? cursor_after("jobs", std::to_string(kFirst + end - 1)) : "";
      EXPECT_EQ(text, to_json(jobs(begin, end), next)) << begin << ' ' << limit;
    }
  }
  EXPECT_EQ(most_read_, ListPage<Job>::kRowsPerPiece + 1);
}

TEST_F(ListPageTest, KnowsItsLastPiece) {
  ListPage<Job> all = page(0, 1000);
  for (int n = 0; n < 3; ++n) {
    EXPECT_TRUE(all.next());
    EXPECT_FALSE(all.is_over());
  }
  EXPECT_TRUE(all.next());
  EXPECT_TRUE(all.is_over());
  EXPECT_FALSE(all.next());
  ListPage<Job> usual = page(0, 100);
  EXPECT_TRUE(usual.next());
  EXPECT_TRUE(usual.is_over());
}

// Jobs that are removed while the page is sent make the page shorter.
TEST_F(ListPageTest, EndsWithTheListThatHasBecomeShorter) {
  ListPage<Job> list = page(0, 1000);
  std::string text = *list.next();
  count_ = 100;
  while (const auto piece = list.next()) text += *piece;
  EXPECT_EQ(text, to_json(jobs(0, 100)));
}

}  // namespace
}  // namespace isomesh::http
