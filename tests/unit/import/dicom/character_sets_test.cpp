// Character sets, and texts that switch between them.
#include <random>

#include <gtest/gtest.h>

#include "base/text.h"
#include "server/import/dicom/elements/text.h"

namespace isomesh::import::dicom {
namespace {

#define REPLACED "\xEF\xBF\xBD"

struct SwitchCase {
  const char* name;
  const char* terms;
  std::string stored;
  std::string utf8;
  TextKind kind = TextKind::kPersonName;
};

class CodeExtensions : public testing::TestWithParam<SwitchCase> {};

TEST_P(CodeExtensions, BecomeUtf8) {
  EXPECT_EQ(decoded(GetParam().stored, GetParam().terms, GetParam().kind), GetParam().utf8);
}

std::string case_name(const testing::TestParamInfo<SwitchCase>& each) { return each.param.name; }

// Some are examples of PS3.5, annexes H to K.
INSTANTIATE_TEST_SUITE_P(
    Sets, CodeExtensions,
    testing::Values(
        SwitchCase{"Default", "", "Adams^John", "Adams^John"},
        SwitchCase{"DefaultWithLatin1", "", "B\xe4r", "Bär"},
        SwitchCase{"DefaultWithUtf8", "", "B\xc3\xa4r", "Bär"},
        SwitchCase{"Latin2", "ISO_IR 101",
                   "W\xb3"
                   "adys\xb3"
                   "aw",
                   "Władysław"},
        SwitchCase{"Cyrillic", "ISO_IR 144", "\xbb\xee\xda\x63\x65\xdc\xd1yp\xd3", "Люкceмбypг"},
        SwitchCase{"Greek", "ISO_IR 126", "\xc4\xe9\xef\xed\xf5\xf3\xe9\xef\xf2", "Διονυσιος"},
        SwitchCase{"Utf8", "ISO_IR 192", "Wang^XiaoDong=\xe7\x8e\x8b^\xe5\xb0\x8f\xe6\x9d\xb1",
                   "Wang^XiaoDong=王^小東"},
        SwitchCase{"BrokenUtf8", "ISO_IR 192", "a\xe7\x8e", "a\xEF\xBF\xBD\xEF\xBF\xBD"},
        SwitchCase{"Gb18030", "GB18030", "Wang=\xcd\xf5^\xd0\xa1\xb6\xab", "Wang=王^小东"},
        SwitchCase{"Japanese", "\\ISO 2022 IR 87", "Yamada=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B",
                   "Yamada=山田^太郎"},
        SwitchCase{"Korean", "\\ISO 2022 IR 149", "Hong=\x1b$)C\xfb\xf3", "Hong=洪"},
        SwitchCase{"Unknown", "ISO_IR 999", "B\xe4r", "Bär"},
        SwitchCase{"ControlCharacters", "ISO_IR 100", "a\nb",
                   "a\xEF\xBF\xBD"
                   "b"}),
    case_name);

// PS3.5: H.3.1, H.3.2, I.2 and K.2.
INSTANTIATE_TEST_SUITE_P(
    Standard, CodeExtensions,
    testing::Values(
        SwitchCase{"Japanese", "\\ISO 2022 IR 87",
                   "Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B=\x1b$B$d$^$@\x1b(B^\x1b$B$?$m$&"
                   "\x1b(B",
                   "Yamada^Tarou=山田^太郎=やまだ^たろう"},
        SwitchCase{"JapaneseWithKatakana", "ISO 2022 IR 13\\ISO 2022 IR 87",
                   "\xd4\xcf\xc0\xde^\xc0\xdb\xb3=\x1b$B;3ED\x1b(J^\x1b$BB@O:\x1b(J=\x1b$B$d$^$@"
                   "\x1b(J^\x1b$B$?$m$&\x1b(J",
                   "ﾔﾏﾀﾞ^ﾀﾛｳ=山田^太郎=やまだ^たろう"},
        SwitchCase{"Korean", "\\ISO 2022 IR 149",
                   "Hong^Gildong=\x1b$)C\xfb\xf3^\x1b$)C\xd1\xce\xd4\xd7=\x1b$)C\xc8\xab^\x1b$)C"
                   "\xb1\xe6\xb5\xbf",
                   "Hong^Gildong=洪^吉洞=홍^길동"},
        SwitchCase{
            "Chinese", "\\ISO 2022 IR 58",
            "Zhang^XiaoDong=\x1b$)A\xd5\xc5^\x1b$)A\xd0\xa1\xb6\xab=", "Zhang^XiaoDong=张^小东="}),
    case_name);

INSTANTIATE_TEST_SUITE_P(
    Programs, CodeExtensions,
    testing::Values(
        SwitchCase{"LatinAndCyrillic", "ISO 2022 IR 100\\ISO 2022 IR 144",
                   "M\xfcller^J=\x1b-L\xbb\xee\xda^\x1b-L\xbb\xee\xda", "Müller^J=Люк^Люк"},
        SwitchCase{"Greek", "\\ISO 2022 IR 126",
                   "Dionysios^A=\x1b-F\xc4\xe9\xef\xed\xf5\xf3\xe9\xef\xf2",
                   "Dionysios^A=Διονυσιος"},
        SwitchCase{"LatinAndJapanese", "ISO 2022 IR 100\\ISO 2022 IR 87",
                   "M\xfcller^J=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B", "Müller^J=山田^太郎"},
        SwitchCase{"BackToLatinFromPairs", "ISO 2022 IR 100\\ISO 2022 IR 87",
                   "\x1b$B;3ED\x1b-A^\x1b$BB@O:\x1b-A=M\xfcller", "山田^太郎=Müller"},
        SwitchCase{"SupplementaryKanji", "\\ISO 2022 IR 87\\ISO 2022 IR 159",
                   "A=\x1b$(D0!\x1b(B^\x1b$B;3\x1b(B", "A=丂^山"},
        SwitchCase{"PairsThatLookLikeDelimiters", "\\ISO 2022 IR 87",
                   "A=\x1b$B=)=U==I=\\\\\x1b(B^B", "A=秋春十表樛^B"},
        SwitchCase{"KatakanaAndBackslash", "ISO_IR 13", "\xb1\\\xb2", "ｱ\\ｲ"},
        SwitchCase{"KoreanWithoutEscape", "\\ISO 2022 IR 149", "Hong=\xfb\xf3", "Hong=洪"},
        SwitchCase{"TermsAfterUtf8", "ISO_IR 192\\ISO 2022 IR 87", "M\xc3\xbcller", "Müller"}),
    case_name);

INSTANTIATE_TEST_SUITE_P(
    Delimiters, CodeExtensions,
    testing::Values(SwitchCase{"OfNames", "ISO 2022 IR 100\\ISO 2022 IR 144",
                               "\x1b-L\xbb^\xfc=\x1b-L\xbb=\xfc", "Л^ü=Л=ü"},
                    SwitchCase{"OfNamesElsewhere", "ISO 2022 IR 100\\ISO 2022 IR 144",
                               "\x1b-L\xbb^\xee=\xda", "Л^ю=к", TextKind::kText},
                    SwitchCase{"OfValues", "ISO 2022 IR 100\\ISO 2022 IR 144", "\x1b-L\xbb\\\xfc",
                               "Л\\ü", TextKind::kText},
                    SwitchCase{"LineEnd", "ISO 2022 IR 100\\ISO 2022 IR 144", "\x1b-L\xbb\r\n\xfc",
                               "Л" REPLACED REPLACED "ü", TextKind::kText},
                    SwitchCase{"Tab", "\\ISO 2022 IR 87", "\x1b$B;3\tED", "山" REPLACED "ED",
                               TextKind::kText}),
    case_name);

INSTANTIATE_TEST_SUITE_P(
    Damage, CodeExtensions,
    testing::Values(
        SwitchCase{"UnknownEscape", "\\ISO 2022 IR 144", "a\x1b-Zb", "a" REPLACED "-Zb"},
        SwitchCase{"CutEscape", "\\ISO 2022 IR 87", "a\x1b$", "a" REPLACED "$"},
        SwitchCase{"LoneEscape", "\\ISO 2022 IR 87", "a\x1b", "a" REPLACED},
        SwitchCase{"HalfAPair", "\\ISO 2022 IR 87", "\x1b$B;3E", "山" REPLACED},
        SwitchCase{"WrongPair", "\\ISO 2022 IR 87", "\x1b$B~~;3", REPLACED "山"},
        SwitchCase{"UpperByteWithoutSet", "\\ISO 2022 IR 87", "a\xfc", "a" REPLACED},
        SwitchCase{"SeveralPossibleSets", "\\ISO 2022 IR 144\\ISO 2022 IR 126", "a\xfc",
                   "a" REPLACED},
        SwitchCase{"UnknownFirstSet", "ISO_IR 999\\ISO 2022 IR 144", "\xfc\x1b-L\xbb", "üЛ"},
        SwitchCase{"EscapeInUtf8", "ISO_IR 192", "a\x1b-Lb", "a" REPLACED "-Lb"},
        SwitchCase{"BeyondUnicode", "ISO_IR 192",
                   "a\xf5\x80\x80\x80"
                   "b\xf4\x90\x80\x80",
                   "a" REPLACED "b" REPLACED},
        SwitchCase{"OnlySeparators", "\\\\\\", "a\xfc", "aü"},
        SwitchCase{"UndeclaredLatin", "", "\xc3\x84 \xc4", "Ã" REPLACED " Ä"},
        SwitchCase{"UndeclaredUtf8", "", "\xc3\x84^\xd0\x9b", "Ä^Л"},
        SwitchCase{"UndeclaredEscape", "", "\xfc\x1b-L\xbb", "üЛ"},
        SwitchCase{"Nothing", "ISO 2022 IR 100", "", ""}),
    case_name);

std::string random_text(std::mt19937& random) {
  const std::vector<std::string> parts = {"\x1b",     "\x1b$",  "\x1b$B",  "\x1b$(D", "\x1b(J",
                                          "\x1b-L",   "\x1b-Z", "\x1b$)C", "\x1b)I",  "^",
                                          "\xf4\x90", "=",      "\\",      "\n"};
  std::string text;
  for (auto count = random() % 40; count > 0; --count) {
    text += random() % 3 == 0 ? parts[random() % parts.size()]
                              : std::string(1, static_cast<char>(random() % 256));
  }
  return text;
}

TEST(CodeExtensionsOfRandomTexts, AreBoundedAndHaveNoControlCharacters) {
  const std::vector<std::string> terms = {"",
                                          "ISO_IR 192",
                                          "GB18030",
                                          "ISO 2022 IR 13\\ISO 2022 IR 87",
                                          "\\ISO 2022 IR 149\\ISO 2022 IR 58",
                                          "ISO_IR 999\\ISO 2022 IR 144",
                                          "ISO 2022 IR 87"};
  load_character_sets();
  std::mt19937 random(7);
  for (int round = 0; round < 2000; ++round) {
    const std::string stored = random_text(random);
    const std::string& set = terms[random() % terms.size()];
    const std::string text = decoded(stored, set, TextKind::kPersonName);
    ASSERT_LE(text.size(), 3 * stored.size()) << set << ' ' << testing::PrintToString(stored);
    ASSERT_FALSE(has_control_characters(text)) << set << ' ' << testing::PrintToString(stored);
    // Valid UTF-8 stays as it is.
    ASSERT_EQ(decoded(text, "ISO_IR 192", TextKind::kText), text);
  }
}

}  // namespace
}  // namespace isomesh::import::dicom
