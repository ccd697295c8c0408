#include <algorithm>
#include <iomanip>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using Kind = Member::Kind;
using testing::AllOf;
using testing::HasSubstr;

const std::string kSamples(kSmallSamples);

std::string mhd(const std::string& data = "head.raw") {
  return metaimage(with(small_metaimage(), "ElementDataFile", data), "");
}

std::string nhdr(const std::string& data = "head.raw") {
  return nrrd(with(small_nrrd(), "data file", data), "");
}

// The archive in each of the three forms.
std::vector<std::string> forms(const std::vector<Member>& members) {
  return {zip(members), tar(members), gzip(tar(members))};
}

void expect_read(const std::vector<Member>& members, const std::string& format) {
  for (const std::string& file : forms(members)) {
    const Outcome outcome = imported(import_bytes(file));
    if (!outcome.imported()) continue;
    EXPECT_EQ(outcome.sample_bytes(), kSmallSamples);
    EXPECT_EQ(outcome.volume.format, format);
  }
}

template <class Matcher>
void expect_refused(const std::vector<Member>& members, const Matcher& matcher,
                    ErrorCode code = ErrorCode::kUnusableVolume) {
  for (const std::string& file : forms(members)) {
    const Outcome outcome = import_bytes(file);
    EXPECT_THAT(outcome.error, matcher);
    EXPECT_EQ(outcome.code, code);
  }
}

TEST(Archive, WithoutFilesSaysSo) {
  for (const std::vector<Member>& members :
       {std::vector<Member>{}, {{"folder", "", Kind::kFolder}}, {{".git/head.nii", "junk"}}}) {
    expect_refused(members, HasSubstr("holds no file"));
  }
  // A file of zeros may be samples.
  EXPECT_EQ(import_bytes(std::string(10241, '\0')).code, ErrorCode::kUnsupportedMedia);
}

TEST(Archive, HoldsOneVolumeOfAnyFormat) {
  expect_read({{"head.nii", nifti({}, kSamples)}}, "nifti");
  expect_read({{"folder", "", Kind::kFolder}, {"folder/head.nii.gz", gzip(nifti({}, kSamples))}},
              "nifti");
  expect_read({{"a name with spaces \xc3\xbc.nrrd", nrrd(small_nrrd(), kSamples)}}, "nrrd");
  expect_read({{"README", "what this is"}, {"head.mha", metaimage(small_metaimage(), kSamples)}},
              "metaimage");
}

TEST(Archive, HoldsAHeaderAndItsData) {
  expect_read({{"head.mhd", mhd()}, {"head.raw", kSamples}}, "metaimage");
  expect_read({{"head.raw", kSamples}, {"head.nhdr", nhdr()}}, "nrrd");
  // Names belong to the header's folder.
  expect_read({{"a/head.mhd", mhd()}, {"b/head.raw", "other"}, {"a/head.raw", kSamples}},
              "metaimage");
}

TEST(Archive, NamesMayBeDeclaredAsUtf8) {
  const std::vector<Member> members = {{"K\xc3\xb6pfe/R\xc3\xbcmpf.mhd", mhd("R\xc3\xbcmpf.raw")},
                                       {"K\xc3\xb6pfe/R\xc3\xbcmpf.raw", kSamples}};
  for (const Utf8Names names : {Utf8Names::kFlag, Utf8Names::kField}) {
    const Outcome outcome = imported(import_bytes(zip_in_utf8(members, names)));
    EXPECT_EQ(outcome.volume.name, "R\xc3\xbcmpf.mhd");
  }
}

// Windows writes names into a ZIP in the PC's old set, and headers in Latin-1, as old TARs do.
TEST(Archive, NamesInOldEncodingsAreRead) {
  const std::string header =
      mhd("Sch\xe4"
          "del.raw");
  std::string zipped =
      zip({{"Sch@del.mhd", header}, {"Sch@del.raw", kSamples}, {"b.nii", nifti({}, kSamples)}});
  std::ranges::replace(zipped, '@', '\x84');
  const std::string tarred = tar({{"Sch\xe4"
                                   "del.mhd",
                                   header},
                                  {"Sch\xe4"
                                   "del.raw",
                                   kSamples},
                                  {"b.nii", nifti({}, kSamples)}});
  for (const std::string& archive : {zipped, tarred}) {
    const Outcome several = import_bytes(archive);
    ASSERT_EQ(several.remedy.choices.size(), 2) << several.error;
    EXPECT_EQ(several.remedy.choices[0].value,
              "Sch\xc3\xa4"
              "del.mhd");
    const Outcome chosen =
        imported(import_bytes(archive, {}, {.member = several.remedy.choices[0].value}));
    EXPECT_EQ(chosen.volume.format, "metaimage");
  }
}

// Programs of macOS write names in decomposed form, also into headers.
TEST(Archive, NamesInATarAreTheirBytes) {
  const std::string data = "Ru\xcc\x88mpf.raw";
  EXPECT_EQ(import_bytes(tar({{"head.mhd", mhd(data)}, {data, kSamples}})).error, "");
}

TEST(Archive, DataMayBeEncodedSkippedAndShared) {
  const Lines lines = with(small_metaimage(), "CompressedData", "True");
  expect_read({{"h.mhd", metaimage(with(lines, "ElementDataFile", "h.zraw"), "")},
               {"h.zraw", zlib(kSamples)}},
              "metaimage");
  expect_read(
      {{"h.nhdr", nrrd(with(with(small_nrrd(), "encoding", "gzip"), "data file", "h.gz"), "")},
       {"h.gz", gzip(kSamples)}},
      "nrrd");
  expect_read({{"h.mhd", metaimage(with(with(small_metaimage(), "HeaderSize", "3"),
                                        "ElementDataFile", "h.raw"),
                                   "")},
               {"h.raw", "###" + kSamples}},
              "metaimage");
  expect_read({{"h.mhd", metaimage(with(with(small_metaimage(), "HeaderSize", "-1"),
                                        "ElementDataFile", "h.raw"),
                                   "")},
               {"h.raw", "####" + kSamples}},
              "metaimage");
  const std::vector<Member> halves = {{"1.raw", kSamples.substr(0, 12)},
                                      {"2.raw", kSamples.substr(12)}};
  expect_read({halves[1], halves[0], {"h.mhd", mhd("LIST") + "1.raw\n2.raw\n"}}, "metaimage");
  Lines listed = small_nrrd();
  listed.emplace_back("data file", "LIST");
  std::string list = nrrd(listed, "1.raw\n2.raw\n");
  list.erase(list.find("LIST\n\n") + 5, 1);
  expect_read({halves[0], halves[1], {"h.nhdr", list}}, "nrrd");
}

// Each slice in a file of its own, as MetaIO and NRRD name them.
TEST(Archive, DataMayBeNamedByAPattern) {
  const Member lower{"head-08.raw", kSamples.substr(0, 12)};
  const Member upper{"head-10.raw", kSamples.substr(12)};
  const Member between{"head-09.raw", "another"};
  for (const std::string said : {"head-%02d.raw 8 10 2", "head-%02i.raw 8 11 2"}) {
    expect_read({upper, between, {"h.mhd", mhd(said)}, lower}, "metaimage");
    expect_read({upper, between, {"h.nhdr", nhdr(said)}, lower}, "nrrd");
  }
  expect_read({upper, lower, {"h.nhdr", nhdr("head-%02u.raw 8 10 2 2")}}, "nrrd");
  expect_read({{"1", lower.bytes}, {"2", upper.bytes}, {"h.mhd", mhd("%d 1 2")}}, "metaimage");
  // MetaIO counts the last axis, from 1 or from the only number.
  expect_read({{"1.raw", lower.bytes}, {"2.raw", upper.bytes}, {"h.mhd", mhd("%d.raw")}},
              "metaimage");
  expect_read({{"9.raw", lower.bytes}, {"10.raw", upper.bytes}, {"h.mhd", mhd("%d.raw 9")}},
              "metaimage");
  // The other way round.
  expect_read({{"9.raw", upper.bytes}, {"10.raw", lower.bytes}, {"h.nhdr", nhdr("%d.raw 10 9 -1")}},
              "nrrd");
  expect_refused({lower, {"h.mhd", mhd("head-%02d.raw 8 10 2")}},
                 HasSubstr("\"head-10.raw\", which is missing"));
  expect_refused({lower, upper, between, {"h.mhd", mhd("head-%02d.raw 8 10 1")}},
                 HasSubstr("has 12 bytes, but the header declares 8"));
}

TEST(Archive, PatternsOfOtherThingsAreRefused) {
  for (const std::string said : {"a%02d.raw", "a%02d.raw 1"}) {
    expect_refused({{"h.nhdr", nhdr(said)}, {"a01.raw", kSamples}}, HasSubstr("not a pattern"));
  }
  for (const std::string said : {"a%02d.raw x",
                                 "a%02d.raw 9223372036854775807",
                                 "a%02d.raw 1 2 0",
                                 "a%02d.raw 2 1",
                                 "a%02d.raw 2 1 5",
                                 "a%d 1 -9223372036854775808",
                                 "a%02d.raw 1 2 -1",
                                 "a%02d.raw 1 x",
                                 "a%02d.raw -1 1",
                                 "a%s.raw 1 2",
                                 "a%n 1 2",
                                 "a%*d 1 2",
                                 "a%d%d 1 2",
                                 "a%d%% 1 2",
                                 "a% 1 2",
                                 "a%9 1 2",
                                 "a%999999999999999999999d 1 2",
                                 "a%10d 1 2",
                                 "a%d 1 99999999999",
                                 "a%d 1 2 3 4 5",
                                 "b 1%d 2"}) {
    expect_refused({{"h.mhd", mhd(said)}, {"a01.raw", kSamples}}, HasSubstr("not a pattern"));
  }
  expect_refused({{"h.mhd", mhd("a%d 0 65536")}}, HasSubstr("names 65537 data files"));
  expect_refused({{"h.mhd", mhd("../a%d.raw 1 2")}}, HasSubstr("outside the header's folder"));
}

TEST(Archive, DataThatIsNotWhatTheHeaderTellsIsRefused) {
  expect_refused({{"head.mhd", mhd()}, {"head.raw", kSamples + std::string(5000, 'x')}},
                 HasSubstr("5024 bytes"));
  expect_refused({{"head.nhdr", nhdr()}, {"head.raw", kSamples.substr(1)}}, HasSubstr("23 bytes"));
  expect_refused({{"head.mhd", mhd()}, {"other.raw", kSamples}}, HasSubstr("which is missing"));
  expect_refused({{"head.mhd", mhd("")}, {"head.raw", kSamples}}, HasSubstr(""));
}

TEST(Archive, HeadersNameOnlyFilesOfTheirFolder) {
  for (const std::string name :
       {"../head.raw", "/etc/passwd", "a/head.raw", "b/../../head.raw", "..", "a\\head.raw"}) {
    expect_refused({{"a/head.mhd", mhd(name)}, {"head.raw", kSamples}, {"a/head.raw", kSamples}},
                   HasSubstr("names the data file"));
    expect_refused({{"a/head.nhdr", nhdr(name)}, {"head.raw", kSamples}},
                   HasSubstr("names the data file"));
  }
}

TEST(Archive, NamesOfMembersAreNoPlaces) {
  const std::string volume = nifti({}, kSamples);
  for (const std::string name :
       {"../../../escaped.nii", "/tmp/escaped.nii", "..", "a/../b", "\xff\xfe.nii"}) {
    for (const std::string& file : forms({{name, volume}})) {
      const Outcome outcome = import_bytes(file);
      EXPECT_TRUE(!outcome.imported() || outcome.sample_bytes() == kSmallSamples) << name;
    }
  }
}

TEST(Archive, AFileWithoutANameIsRefused) {
  const std::string file = tar({{"head.nii", nifti({}, kSamples)}, {"notes", "text"}});
  EXPECT_TRUE(import_bytes(file).imported());
  const Outcome outcome = import_bytes(without_name(file, "notes"));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("member 2 has no name"));
}

TEST(Archive, LinksDevicesAndHiddenFilesArePassedOver) {
  const Member volume{"head.nii", nifti({}, kSamples)};
  expect_read({volume, {"__MACOSX/head.nii", "junk"}, {".DS_Store", "junk"}}, "nifti");
  expect_read({{"link.nii", "/etc/passwd", Kind::kLink}, volume}, "nifti");
  const Outcome tarred = imported(import_bytes(
      tar({volume, {"again.nii", "head.nii", Kind::kHardLink}, {"null", "", Kind::kDevice}})));
}

// Clients send all files of a folder.
TEST(Archive, FilesThatAreNoPartOfAVolumeAreIgnored) {
  const std::vector<Member> beside = {{"README.txt", "what this is"},
                                      {"report.pdf", "%PDF-1.7\n%\xe2\xe3\xcf\xd3"},
                                      {"report.docx", zip({{"word/document.xml", "<w/>"}})},
                                      {"head.vtp", vti({.kind = "PolyData"}, "")},
                                      {"head.stl", "solid head\nendsolid head\n"},
                                      {"Thumbs.db", "\xd0\xcf\x11\xe0"},
                                      {".DS_Store", "junk"},
                                      {".git/head.nii", nifti({}, kSamples)},
                                      {"a/.hidden/head.nii", nifti({}, kSamples)},
                                      {"a/__MACOSX/head.nii", "junk"},
                                      {"empty", ""}};
  const auto names = [](const Volume& volume) {
    std::vector<std::string> all;
    for (const IgnoredObject& ignored : volume.ignored) all.push_back(ignored.name);
    return all;
  };
  const auto named = testing::UnorderedElementsAre("README.txt", "report.pdf", "report.docx",
                                                   "head.vtp", "head.stl", "Thumbs.db");
  std::vector<Member> series = beside;
  for (const auto& [name, bytes] : DicomSeries{}.files()) series.push_back({"a/" + name, bytes});
  std::vector<Member> single = beside;
  single.push_back({"./head.nii", nifti({}, kSamples)});
  for (const std::vector<Member>& members : {series, single}) {
    for (const std::string& file : forms(members)) {
      const Outcome outcome = imported(import_bytes(file));
      EXPECT_THAT(names(outcome.volume), named);
    }
  }
}

TEST(Archive, DataMayLieInAFolderBelowItsHeader) {
  expect_read({{"v/h.mhd", mhd("sub/h.raw")}, {"v/sub/h.raw", kSamples}}, "metaimage");
  expect_read({{"./h.nhdr", nhdr("./sub/./h.raw")}, {"./sub/h.raw", kSamples}}, "nrrd");
}

TEST(Archive, OneOfSeveralVolumesIsChosenByItsName) {
  const std::string other(kSamples.rbegin(), kSamples.rend());
  const std::string file = zip({{"a.nii", nifti({}, kSamples)},
                                {"b/h.mhd", mhd("h.raw")},
                                {"b/h.raw", other},
                                {"readme", "text"}});
  const Outcome open = import_bytes(file);
  EXPECT_THAT(open.remedy.choices, testing::ElementsAre(Choice{"member", "a.nii", "NIfTI"},
                                                        Choice{"member", "b/h.mhd", "MetaImage"}));
  const Outcome chosen = import_bytes(file, {}, {.member = "b/h.mhd"});
  EXPECT_EQ(chosen.sample_bytes(), other);
  EXPECT_EQ(chosen.volume.name, "h.mhd");
  EXPECT_EQ(import_bytes(file, {}, {.member = "b/h.raw"}).remedy.choices.size(), 2);
  EXPECT_THAT(import_bytes(nifti({}, kSamples), {}, {.member = "a.nii"}).error,
              HasSubstr("member"));
}

TEST(Archive, OneFileTwiceIsTakenOnce) {
  const std::string volume = nifti({}, kSamples);
  const std::string file = zip({{"a.nii", volume}, {"old/a.nii", volume}, {"c.nii", volume}});
  for (const char* asked : {"", "a.nii", "c.nii"}) {
    const Outcome outcome = imported(import_bytes(file, {}, {.member = asked}));
    EXPECT_EQ(outcome.volume.name, "a.nii");
    EXPECT_THAT(codes_of(outcome), testing::ElementsAre("duplicate-file"));
    ASSERT_EQ(outcome.volume.ignored.size(), 2U);
    EXPECT_EQ(outcome.volume.ignored[0].name, "a.nii");
    EXPECT_THAT(outcome.volume.ignored[1].reason, HasSubstr("same as \"a.nii\""));
  }
  // Beside another volume it is one of two.
  const std::string other = nrrd(small_nrrd(), kSamples);
  EXPECT_EQ(import_bytes(zip({{"a.nii", volume}, {"b.nii", volume}, {"c.nrrd", other}}))
                .remedy.choices.size(),
            2U);
}

TEST(Archive, AHeaderTwiceIsOneVolumeOnlyWithTheSameData) {
  const std::string other(kSamples.rbegin(), kSamples.rend());
  const auto both = [&](const std::string& second) {
    return import_bytes(zip({{"a/head.mhd", mhd()},
                             {"a/head.raw", kSamples},
                             {"b/head.mhd", mhd()},
                             {"b/head.raw", second}}));
  };
  EXPECT_THAT(codes_of(both(kSamples)), testing::ElementsAre("duplicate-file"));
  EXPECT_EQ(both(other).remedy.choices.size(), 2U);
}

// Large members are unpacked when they are needed, and no further than their headers tell.
TEST(Archive, LargeMembersAreReadWhole) {
  const std::string samples(std::size_t{2} << 20, 'a');
  const Lines large = with(small_nrrd(), "sizes", "128 128 128");
  const std::string other = samples + std::string(10, 'b');
  const std::vector<Member> members = {{"notes.bin", std::string(std::size_t{3} << 20, 'x')},
                                       {"h.raw", samples},
                                       {"h.nhdr", nrrd(with(large, "data file", "h.raw"), "")},
                                       {"a.nrrd", nrrd(large, other)},
                                       {"b.nrrd", nrrd(large, other)},
                                       {"c.nrrd.gz", gzip(nrrd(large, samples))}};
  for (const std::string& file : forms(members)) {
    for (const char* asked : {"h.nhdr", "a.nrrd", "b.nrrd", "c.nrrd.gz"}) {
      const Outcome outcome = import_bytes(file, {}, {.member = asked});
      ASSERT_EQ(outcome.error, "") << asked;
      EXPECT_EQ(outcome.sample_bytes(), samples) << asked;
    }
    EXPECT_EQ(import_bytes(file).remedy.choices.size(), 3U);
  }
}

TEST(Archive, MembersAreNoLargerThanTheirHeadersTell) {
  const std::string zeros(std::size_t{3} << 20, '\0');
  const auto refused = [](const std::vector<Member>& members) {
    expect_refused(members, HasSubstr("that its header allows"));
  };
  refused({{"a.nrrd", nrrd(small_nrrd(), zeros)}});
  refused({{"a.nii", nifti({}, zeros)}});
  refused({{"a.mha", metaimage(small_metaimage(), zeros)}});
  refused({{"a.vti", vti({}, kSamples) + zeros}});
  refused({{"h.mhd", mhd()}, {"head.raw", zeros}});
  refused({{"h.nhdr", nhdr()}, {"head.raw", zeros}});
  refused({{"h.hdr", nifti({.magic = "ni1", .vox_offset = 0}, "")}, {"h.img", zeros}});
}

TEST(Archive, SeveralVolumesAreNamed) {
  const std::string volume = nifti({}, kSamples);
  const std::string other = nifti({.pixdim = {1, 2, 1, 1, 1, 1, 1, 1}}, kSamples);
  expect_refused({{"a.nii", volume}, {"b/c.nii", other}},
                 AllOf(HasSubstr("2 volumes"), HasSubstr("\"a.nii\", \"b/c.nii\"")));
}

// The first thousand alone would look like all of them.
TEST(Archive, MoreVolumesThanOneUploadMayHaveAreRefused) {
  std::vector<Member> members;
  for (int n = 0; n < 1001; ++n) {
    std::string samples = kSamples;
    samples[0] = static_cast<char>(n);
    samples[1] = static_cast<char>(n / 256);
    members.push_back({"v" + std::to_string(n) + ".nrrd", nrrd(small_nrrd(), samples)});
  }
  EXPECT_THAT(import_bytes(zip(members)).error,
              HasSubstr("holds 1001 volumes, more than the 1000 that one upload may have"));
  members.pop_back();
  EXPECT_THAT(import_bytes(zip(members)).error, HasSubstr("holds 1000 volumes. Choose one"));
}

TEST(Archive, WithoutAVolumeItIsUnsupported) {
  expect_refused({{"a.txt", "text"}, {"b.txt", "more"}}, HasSubstr("2 files"),
                 ErrorCode::kUnsupportedMedia);
  expect_refused({{"a", ""}}, HasSubstr("0 files"), ErrorCode::kUnsupportedMedia);
}

TEST(Archive, WithinAnArchiveIsRefused) {
  const Member volume{"head.nii", nifti({}, kSamples)};
  for (const std::string& inner : forms({volume})) {
    expect_refused({{"inner", inner}}, HasSubstr("another archive"));
  }
}

TEST(Archive, OneNameTwiceIsRefused) {
  const Member volume{"head.nii", nifti({}, kSamples)};
  expect_refused({volume, volume}, HasSubstr("twice"));
}

TEST(Archive, EncryptedIsRefused) {
  const Outcome outcome = import_bytes(zip({{"head.nii", nifti({}, kSamples)}}, Locked::kYes));
  EXPECT_THAT(outcome.error, HasSubstr("encrypted"));
}

TEST(Archive, IsBounded) {
  const SizeLimits limits = {.max_sample_bytes = 1000};
  const std::string zeros(std::size_t{3} << 20, '\0');
  for (const std::string& file : forms({{"zeros", zeros}})) {
    EXPECT_EQ(import_bytes(file, limits).imported(), false);
  }
  EXPECT_EQ(import_bytes(zip({{"zeros", zeros}}), limits).code, ErrorCode::kTooLarge);
  std::vector<Member> many(20001);
  for (std::size_t at = 0; at < many.size(); ++at) {
    many[at] = {std::to_string(at), "", Kind::kFolder};
  }
  EXPECT_THAT(import_bytes(tar(many)).error, HasSubstr("more than the 20000 members"));
}

// A TAR of a member of which nothing is written but its size (type S of GNU's tar).
std::string sparse_tar(std::uint64_t bytes) {
  const auto octal = [](std::uint64_t number) {
    std::ostringstream text;
    text << std::oct << std::setw(11) << std::setfill('0') << number << '\0';
    return text.str();
  };
  std::string file = tar({{"sparse", ""}});
  file[156] = 'S';
  file.replace(257, 8, std::string("ustar  \0", 8));
  file.replace(345, 155, std::string(155, '\0'));
  file.replace(386, 24, octal(bytes) + octal(0));
  file.replace(483, 12, octal(bytes));
  file.replace(148, 8, std::string(8, ' '));
  std::uint64_t sum = 0;
  for (const char c : file.substr(0, 512)) sum += static_cast<unsigned char>(c);
  file.replace(148, 8, octal(sum).substr(5, 6) + std::string("\0 ", 2));
  return file;
}

TEST(Archive, SparseFilesAreRefused) {
  EXPECT_THAT(import_bytes(sparse_tar(50'000'000)).error, HasSubstr("sparse"));
}

TEST(Archive, ATruncatedTarIsRefusedAsSuch) {
  const std::string file =
      tar({{"head.nii", nifti({}, kSamples)}, {"other", std::string(5000, 'x')}});
  for (const std::size_t bytes : {600, 900, 2000, 4000}) {
    EXPECT_THAT(import_bytes(file.substr(0, bytes)).error, HasSubstr("runcated")) << bytes;
  }
}

TEST(Archive, SomethingBehindATarIsRefused) {
  const std::string file = tar({{"head.nii", nifti({}, kSamples)}});
  EXPECT_TRUE(import_bytes(file + std::string(5120, '\0')).imported());
  EXPECT_THAT(import_bytes(file + "garbage").error,
              HasSubstr("followed by data that is not part of it"));
}

TEST(Archive, ASeriesThatIsNotThereIsNotChosen) {
  const Folder folder;
  const auto source = folder.write("upload", zip({{"head.nii", nifti({}, kSamples)}}));
  ImportTask task = {.source = source, .scratch = folder.path(""), .target = folder.path("target")};
  task.options.series = "1.2.3";
  EXPECT_THROW(import_volume(task), Error);
}

}  // namespace
}  // namespace isomesh::import::test
