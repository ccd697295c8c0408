#include "base/text.h"

#include <string>

#include <gtest/gtest.h>

namespace isomesh {
namespace {

const std::string kReplaced = "\xef\xbf\xbd";

// Control characters but tabs, and the 66 noncharacters of Unicode; nothing beside them.
TEST(Text, WhatNobodySeesIsFoundAndReplaced) {
  for (const std::string unseen :
       {"\x01", "\x1f", "\x7f", "\u0080", "\u009f", "\ufdd0", "\ufdef", "\ufffe", "\uffff",
        "\U0001fffe", "\U0003ffff", "\U000ffffe", "\U0010ffff"}) {
    EXPECT_TRUE(has_control_characters("a" + unseen + "b")) << testing::PrintToString(unseen);
    EXPECT_TRUE(has_control_characters(unseen));
    EXPECT_EQ(printable("a" + unseen + "b"), "a" + kReplaced + "b")
        << testing::PrintToString(unseen);
  }
  for (const std::string seen : {"a b", "\u00a0", "\u00ff", "\ufdcf", "\ufdf0", "\ufffd",
                                 "\U0001fffd", "\U00010000", "\u6cf7", "\U0001f9e0"}) {
    EXPECT_FALSE(has_control_characters(seen)) << seen;
    EXPECT_EQ(printable(seen), seen);
  }
  EXPECT_FALSE(has_control_characters("a\tb"));
  EXPECT_EQ(printable("a\tb"), "a" + kReplaced + "b");
}

// Text that ends within a character, or that never was UTF-8, is left to its decoder.
TEST(Text, HalfACharacterIsNoControlCharacter) {
  for (const std::string half : {"\xc2", "\xef\xbf", "\xf0\x9f\xbf", "\xff"}) {
    EXPECT_FALSE(has_control_characters(half));
    EXPECT_EQ(printable(half), half);
  }
}

TEST(Text, PercentEncodingKeepsOnlyWhatIsUnreserved) {
  EXPECT_EQ(percent_encode(""), "");
  EXPECT_EQ(percent_encode("azAZ09-._~"), "azAZ09-._~");
  EXPECT_EQ(percent_encode("/?#%&=+ ,:\n"), "%2F%3F%23%25%26%3D%2B%20%2C%3A%0A");
  EXPECT_EQ(percent_encode("\xc3\xa4"), "%C3%A4");
  EXPECT_EQ(percent_encode(std::string_view("a\0b", 3).substr(0, 2)), "a%00");
}

}  // namespace
}  // namespace isomesh
