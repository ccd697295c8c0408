#include "server/import/labels/label_table.h"

#include <limits>

#include <gmock/gmock.h>

#include "server/import/labels/combinations.h"
#include "server/volume/labels.h"
#include "tests/support/errors.h"

namespace isomesh::import::test {
namespace {

using isomesh::test::code_thrown_by;
using testing::ElementsAre;

TEST(LabelName, IsShortUtf8WithoutControlCharacters) {
  EXPECT_EQ(label_name("  left kidney "), "left kidney");
  EXPECT_EQ(label_name("a\nb\x7f"),
            "a\xef\xbf\xbd"
            "b\xef\xbf\xbd");
  EXPECT_EQ(label_name("a\xff"), "a\xef\xbf\xbd");
  EXPECT_EQ(label_name("a\ufffe\u0085"), "a\ufffd\ufffd");
  EXPECT_EQ(label_name("Lo\u0308ffel"), "L\u00f6ffel");
  EXPECT_EQ(label_name(std::string(300, 'x')), std::string(255, 'x'));
  // Characters of two bytes are not cut in two, and what becomes longer is cut again.
  std::string umlauts;
  for (int at = 0; at < 200; ++at) umlauts += "\xc3\xbc";
  EXPECT_EQ(label_name(umlauts), umlauts.substr(0, 254));
  const LabelEntry replaced = {.label = 1, .name = label_name(std::string(255, '\xff'))};
  EXPECT_EQ(replaced.name.size(), 255U);
  EXPECT_TRUE(volume::is_label_table(std::vector{replaced}));
}

TEST(LabelColor, IsClampedAndRounded) {
  EXPECT_EQ(label_color({0, 0.5, 1}), "#0080ff");
  EXPECT_EQ(label_color({-1, 2, 1.0 / 255}), "#00ff01");
  EXPECT_EQ(label_color({0, 0, std::numeric_limits<double>::quiet_NaN()}), std::nullopt);
}

TEST(LabelTable, HasTheFirstOfSeveralEntries) {
  const auto table =
      label_table({{.label = 7, .name = "a"}, {.label = -1}, {.label = 7, .name = "b"}});
  EXPECT_THAT(table, ElementsAre(LabelEntry{.label = -1}, LabelEntry{.label = 7, .name = "a"}));
  EXPECT_EQ(code_thrown_by([] {
              std::vector<LabelEntry> many(70'000);
              for (std::size_t at = 0; at < many.size(); ++at) {
                many[at].label = static_cast<std::int64_t>(at);
              }
              label_table(many);
            }),
            ErrorCode::kUnusableVolume);
  EXPECT_EQ(code_thrown_by([] {
              std::vector<LabelEntry> long_names(20'000);
              for (std::size_t at = 0; at < long_names.size(); ++at) {
                long_names[at] = {.label = static_cast<std::int64_t>(at),
                                  .name = std::string(255, 'x')};
              }
              label_table(long_names);
            }),
            ErrorCode::kUnusableVolume);
}

// A state that no sample has in the end has no value.
TEST(Combinations, OnTheWayToOthersTakeNoValue) {
  Combinations combinations(3);
  const auto two = combinations.with(combinations.with(Combinations::kNone, 1), 2);
  const auto three = combinations.with(two, 3);
  EXPECT_EQ(combinations.value(three), 4U);
  EXPECT_THAT(combinations.entries({}), ElementsAre(LabelEntry{.label = 1, .values = {4}},
                                                    LabelEntry{.label = 2, .values = {4}},
                                                    LabelEntry{.label = 3, .values = {4}}));
}

}  // namespace
}  // namespace isomesh::import::test
