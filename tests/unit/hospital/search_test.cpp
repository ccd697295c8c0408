// Searches in PACS that treat `limit` and `offset` in different ways.
#include "server/hospital/dicomweb/search.h"

#include <charconv>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/hospital/orders/pacs.h"
#include "tests/support/errors.h"

namespace isomesh::dicomweb {
namespace {

using orders::PacsFailure;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

constexpr std::size_t kAny = std::numeric_limits<std::size_t>::max();

// A PACS with that many instances.
struct Pacs {
  std::size_t count = 0;
  std::size_t largest_page = kAny;   // it returns fewer results than the limit
  std::size_t largest_limit = kAny;  // it rejects others
  std::string refusal = "limit must be between 1 and 40";
  bool has_offset = true;
  bool rejects_offset = false;  // other than 0
  bool has_limit = true;
  bool warns = false;
  std::vector<std::string> targets = {};

  SearchPage page(const std::string& target) {
    targets.push_back(target);
    const std::size_t limit = number_after(target, "&limit=").value_or(kAny);
    const std::size_t offset = number_after(target, "&offset=").value_or(0);
    if (limit != kAny && limit > largest_limit) return {.refusal = refusal};
    if (offset > 0 && rejects_offset) return {.refusal = "offset is unknown"};
    const std::size_t begin = has_offset ? std::min(offset, count) : 0;
    const std::size_t most = std::min(has_limit ? limit : kAny, largest_page);
    const std::size_t end = most < count - begin ? begin + most : count;
    SearchPage result;
    for (std::size_t n = begin; n < end; ++n) {
      result.objects.push_back({.instance = "1." + std::to_string(n)});
    }
    result.has_more = warns && end < count;
    return result;
  }

  static std::optional<std::size_t> number_after(const std::string& target,
                                                 const std::string& name) {
    const std::size_t at = target.find(name);
    if (at == std::string::npos) return std::nullopt;
    std::size_t number = 0;
    std::from_chars(target.data() + at + name.size(), target.data() + target.size(), number);
    return number;
  }

  SearchResults search(const std::optional<std::string>& only = {}) {
    return search_all({.target = "/i?x", .uid = &PeersObject::instance, .only = only},
                      [this](const std::string& target) { return page(target); });
  }
};

TEST(Search, FindsAllByPagesOfAHundred) {
  for (const std::size_t count : {0U, 1U, 99U, 100U, 101U, 1000U, 1234U}) {
    Pacs pacs{.count = count};
    EXPECT_THAT(pacs.search().objects, SizeIs(count));
    for (const std::string& target : pacs.targets) EXPECT_THAT(target, HasSubstr("&limit=100&"));
    EXPECT_LE(pacs.targets.size(), count / 100 + 2);
  }
}

TEST(Search, FindsAllThoughPagesAreSmallerThanTheLimit) {
  Pacs pacs{.count = 333, .largest_page = 50, .warns = true};
  const SearchResults results = pacs.search();
  EXPECT_THAT(results.objects, SizeIs(333));
  EXPECT_FALSE(results.is_cut);
}

TEST(Search, FindsAllThoughOffsetsAreIgnored) {
  for (const std::size_t count : {0U, 12U, 99U, 100U, 101U, 777U}) {
    for (const bool has_limit : {true, false}) {
      Pacs pacs{.count = count, .has_offset = false, .has_limit = has_limit};
      EXPECT_THAT(pacs.search().objects, SizeIs(count)) << has_limit;
      EXPECT_LE(pacs.targets.size(), 3U);
    }
  }
}

TEST(Search, FindsAllThoughOffsetsAreRejected) {
  for (const std::size_t count : {12U, 100U, 777U}) {
    Pacs pacs{.count = count, .rejects_offset = true};
    EXPECT_THAT(pacs.search().objects, SizeIs(count));
  }
}

TEST(Search, TellsThatThePacsHasMoreButDoesNotReturnIt) {
  Pacs pacs{.count = 333, .largest_page = 50, .has_offset = false, .warns = true};
  EXPECT_TRUE(pacs.search().is_cut);
  Pacs full{.count = 333, .largest_page = 100, .has_offset = false, .warns = true};
  EXPECT_TRUE(full.search().is_cut);
  // One object is enough if it is the one.
  EXPECT_FALSE(full.search("1.7").is_cut);
}

TEST(Search, TakesTheLimitThatARefusalNames) {
  Pacs pacs{.count = 130, .largest_limit = 40};
  EXPECT_THAT(pacs.search().objects, SizeIs(130));
  EXPECT_THAT(pacs.targets.at(1), HasSubstr("&limit=40&offset=0"));
  // The first number that is smaller may be another one: then it is the next.
  Pacs talks{.count = 30, .largest_limit = 40, .refusal = "error 99: limit 100 is above 40"};
  EXPECT_THAT(talks.search().objects, SizeIs(30));
}

TEST(Search, IsWithoutALimitWhereEachOneIsRejected) {
  Pacs pacs{.count = 30, .largest_limit = 0, .refusal = "unknown parameter"};
  EXPECT_THAT(pacs.search().objects, SizeIs(30));
  EXPECT_THAT(pacs.targets.back(), Not(HasSubstr("limit")));
}

TEST(Search, ThatIsRejectedThrows) {
  const SearchQuery query = {.target = "/i?x", .uid = &PeersObject::instance};
  int requests = 0;
  const FetchPage refuses = [&](const std::string&) {
    ++requests;
    return SearchPage{.refusal = "the limit is 98, 97 or 96"};
  };
  EXPECT_THROW(search_all(query, refuses), PacsFailure);
  EXPECT_EQ(requests, 5);
  EXPECT_EQ(test::code_thrown_by([&] {
              search_all(query, [](const std::string&) {
                return SearchPage{.objects = {PeersObject{.series = "1.2"}}};
              });
            }),
            ErrorCode::kPacsUnreachable)
      << "objects without UIDs";
}

TEST(Search, EndsWhereAPacsInventsObjects) {
  std::size_t next = 0;
  const FetchPage invents = [&](const std::string&) {
    SearchPage page;
    for (int n = 0; n < 100; ++n) page.objects.push_back({.instance = std::to_string(++next)});
    return page;
  };
  const SearchQuery query = {.target = "/i?x", .uid = &PeersObject::instance};
  EXPECT_EQ(test::code_thrown_by([&] { search_all(query, invents); }), ErrorCode::kTooLarge);
}

TEST(Search, ForOneObjectFindsItThoughItsUidIsIgnored) {
  Pacs pacs{.count = 1234};
  EXPECT_THAT(pacs.search("1.150").objects, SizeIs(200)) << "ends with its page";
}

TEST(Search, KnowsTheLimitOfRefusalsOfOtherKinds) {
  EXPECT_EQ(limit_named_in("Invalid value for Limit: 100 is not in [1, 50]", 100), 50U);
  EXPECT_EQ(limit_named_in(R"({"loc":["query","limit"],"msg":"less than or equal to 25"})", 100),
            25U);
  EXPECT_EQ(limit_named_in("limit 200", 100), std::nullopt);
  EXPECT_EQ(limit_named_in("limit", 100), std::nullopt);
  EXPECT_EQ(limit_named_in("no 50", 100), std::nullopt);
  EXPECT_EQ(limit_named_in("limit 99999999999999999999999999", 100), std::nullopt);
  EXPECT_EQ(limit_named_in("limit 0", 100), std::nullopt);
}

}  // namespace
}  // namespace isomesh::dicomweb
