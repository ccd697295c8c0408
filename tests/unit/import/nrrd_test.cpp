#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/geometry.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

Outcome import_nrrd(const Lines& lines, std::string_view payload = kSmallSamples) {
  return import_bytes(nrrd(lines, payload));
}

Outcome import_with(const std::string& name, const std::string& value) {
  return import_nrrd(with(small_nrrd(), name, value));
}

template <class Sample>
std::string numbers(const std::vector<Sample>& samples, std::string_view separator) {
  std::ostringstream text;
  text.precision(17);
  for (const Sample sample : samples) text << +sample << separator;
  return text.str();
}

std::string hex(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char byte : bytes) {
    const auto value = static_cast<unsigned char>(byte);
    text += kDigits[value / 16];
    text += kDigits[value % 16];
    if (text.size() % 61 == 0) text += '\n';
  }
  return text;
}

template <class Sample>
void expect_all_encodings(const std::string& type) {
  const auto samples = some_samples<Sample>(24);
  Lines lines = with(small_nrrd(), "type", type);
  for (const bool big_endian : {false, true}) {
    lines = with(lines, "endian", big_endian ? "big" : "little");
    const std::string raw = bytes_of(samples, big_endian);
    const auto imported = [&](const std::string& encoding, const std::string& payload) {
      const Outcome outcome = import_nrrd(with(lines, "encoding", encoding), payload);
      EXPECT_EQ(outcome.error, "") << type << " " << encoding;
      EXPECT_EQ(samples_of<Sample>(outcome), samples) << type << " " << encoding;
      EXPECT_EQ(outcome.volume.format, "nrrd");
    };
    imported("raw", raw);
    imported("gzip", gzip(raw));
    imported("gz", gzip(raw.substr(0, 7)) + gzip(raw.substr(7)));
    imported("hex", hex(raw));
    imported("ascii", numbers(samples, " "));
    imported("text", numbers(samples, "\n"));
    imported("txt", numbers(samples, ", "));
  }
}

TEST(Nrrd, IsReadInEveryTypeEncodingAndByteOrder) {
  expect_all_encodings<std::uint8_t>("uchar");
  expect_all_encodings<std::int8_t>("signed char");
  expect_all_encodings<std::uint16_t>("unsigned short");
  expect_all_encodings<std::int16_t>("short");
  expect_all_encodings<std::uint32_t>("uint32_t");
  expect_all_encodings<std::int32_t>("int");
  expect_all_encodings<float>("float");
  expect_all_encodings<double>("double");
}

TEST(Nrrd, IsReadInsideGzip) {
  const Outcome outcome = import_bytes(gzip(nrrd(small_nrrd(), kSmallSamples)));
  EXPECT_EQ(outcome.sample_bytes(), kSmallSamples);
}

TEST(Nrrd, TurnsItsSpaceIntoLps) {
  Lines lines = with(small_nrrd(), "space directions", "(0,2,0) (-3,0,0) (0,0,4)");
  lines = with(lines, "space origin", "(10,20,30)");
  const auto geometry = [&](const std::string& space) {
    const Outcome outcome = import_nrrd(with(lines, "space", space));
    EXPECT_EQ(outcome.error, "") << space;
    EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{2, 3, 4})) << space;
    return outcome.volume.geometry;
  };
  for (const char* space : {"left-posterior-superior", "LPS", "scanner-xyz", "3D-right-handed"}) {
    EXPECT_EQ(geometry(space).origin, (Vector3{10, 20, 30})) << space;
    EXPECT_EQ(geometry(space).direction, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  }
  for (const char* space : {"right-anterior-superior", "RAS"}) {
    EXPECT_EQ(geometry(space).origin, (Vector3{-10, -20, 30})) << space;
    EXPECT_EQ(geometry(space).direction, (std::array<double, 9>{0, 1, 0, -1, 0, 0, 0, 0, 1}));
  }
  for (const char* space : {"left-anterior-superior", "LAS"}) {
    EXPECT_EQ(geometry(space).origin, (Vector3{10, -20, 30})) << space;
    EXPECT_EQ(geometry(space).direction, (std::array<double, 9>{0, -1, 0, -1, 0, 0, 0, 0, 1}));
  }
}

TEST(Nrrd, RefusesSpacesThatItCannotPlace) {
  EXPECT_THAT(import_with("space", "3D-left-handed").error, HasSubstr("left-handed"));
  EXPECT_EQ(import_with("space", "3D-left-handed").remedy.overridable, "space-assumed");
  const std::string left = nrrd(with(small_nrrd(), "space", "3D-left-handed"), kSmallSamples);
  const Outcome accepted = import_bytes(left, {}, {.accept = {"space-assumed"}});
  EXPECT_EQ(accepted.sample_bytes(), kSmallSamples);
  EXPECT_THAT(codes_of(accepted), testing::ElementsAre("space-assumed"));
  EXPECT_THAT(import_with("space", "RAST").error, HasSubstr("rast"));
  EXPECT_THAT(import_with("space", "outer").error, HasSubstr("outer"));
}

TEST(Nrrd, ReadsPlainSpacingsAndMins) {
  Lines lines = {{"type", "uint8"},
                 {"dimension", "3"},
                 {"sizes", "4 3 2"},
                 {"spacings", "1 2.5 0.5"},
                 {"centers", "cell cell cell"},
                 {"axis mins", "0 0 0"},
                 {"encoding", "raw"}};
  const Outcome outcome = imported(import_nrrd(lines));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{1, 2.5, 0.5}));
}

TEST(Nrrd, HonoursItsUnits) {
  const Outcome microns = import_with("space units", "\"um\" \"um\" \"um\"");
  EXPECT_EQ(microns.volume.geometry.spacing, (Vector3{0.001, 0.001, 0.001}));
  EXPECT_EQ(import_with("space units", "\"mm\" \"mm\" \"mm\"").error, "");
  EXPECT_THAT(import_with("space units", "\"mm\" \"um\" \"mm\"").error,
              HasSubstr("different units"));
  EXPECT_THAT(import_with("space units", "\"ell\" \"ell\" \"ell\"").error, HasSubstr("ell"));
  Lines lines = with(with(small_nrrd(), "space", ""), "space directions", "");
  lines = with(with(lines, "space origin", ""), "dimension", "4");
  lines = with(with(lines, "sizes", "1 4 3 2"), "spacings", "nan 1 2 3");
  for (const char* kind : {"list", "time"}) {
    const std::string kinds = std::string(kind) + " domain domain domain";
    const Outcome outcome =
        import_nrrd(with(with(lines, "kinds", kinds), "units", "\"s\" \"um\" \"um\" \"um\""));
    ASSERT_EQ(outcome.error, "") << kind;
    EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{0.001, 0.002, 0.003}));
  }
}

TEST(Nrrd, MinsAndMaxsMustFitTheSpacings) {
  const Lines plain =
      with(with(with(small_nrrd(), "space", ""), "space directions", ""), "space origin", "");
  const auto of = [&](const std::string& maxs) {
    const Lines lines = with(with(plain, "axis mins", "10 20 30"), "spacings", "1.5 2 3");
    return import_bytes(nrrd(with(lines, "axis maxs", maxs), kSmallSamples));
  };
  for (const char* fitting : {"16 26 36", "14.5 24 33", "16.001 26 33", "nan nan nan"}) {
    EXPECT_EQ(of(fitting).volume.geometry.spacing, (Vector3{1.5, 2, 3})) << of(fitting).error;
  }
  EXPECT_THAT(of("16 30 36").error,
              HasSubstr("3 samples with a spacing of 2 do not fit between the axis min 20 and the "
                        "axis max 30"));
}

TEST(Nrrd, RefusesSpacingsThatCannotBe) {
  for (const char* directions :
       {"(1,0,0) (0,nan,0) (0,0,1)", "(1,0,0) none (0,0,1)", "(1,0,0) (0,0,0) (0,0,1)",
        "(1,0,0) (1,0,0) (0,0,1)", "(1,0,0) (0,inf,0) (0,0,1)", "(1,0) (0,1) (0,0)",
        "(1,0,0) (0,1,0)", "nonsense",
        // ITK takes such steps for 1 mm along an axis of its own choice.
        "(1e200,0,0) (0,1,0) (0,0,1)", "(1e-200,0,0) (0,1,0) (0,0,1)",
        "(1e155,0,0) (0,1e155,0) (0,0,1e155)", "(1e100,0,0) (0,1e100,0) (0,0,1e100)",
        "(1e-170,0,0) (0,1e-170,0) (0,0,1e-170)"}) {
    const Outcome outcome = import_with("space directions", directions);
    EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume) << directions;
  }
  for (const char* spacings : {"1 nan 1", "1 -1 1", "1 0 1", "1 1", "a b c"}) {
    const Lines lines = {{"type", "uint8"},
                         {"dimension", "3"},
                         {"sizes", "4 3 2"},
                         {"spacings", spacings},
                         {"encoding", "raw"}};
    EXPECT_EQ(import_nrrd(lines).code, ErrorCode::kUnusableVolume) << spacings;
  }
  // Also of an axis of one sample, beyond those of space.
  EXPECT_EQ(import_nrrd({{"type", "uint8"},
                         {"dimension", "4"},
                         {"sizes", "4 3 2 1"},
                         {"spacings", "1 1 1 0"},
                         {"encoding", "raw"}})
                .code,
            ErrorCode::kUnusableVolume);
  EXPECT_FALSE(import_with("space origin", "(nan,0,0)").imported());
  EXPECT_FALSE(import_with("space origin", "(0,0,nan)").imported());
}

TEST(Nrrd, RefusesFieldsOfSpaceWithoutOne) {
  Lines lines = with(small_nrrd(), "space", "");
  EXPECT_THAT(import_nrrd(lines).error, HasSubstr("directions, but no space"));
  lines = with(lines, "space directions", "");
  EXPECT_THAT(import_nrrd(lines).error, HasSubstr("origin, but no space"));
  EXPECT_TRUE(import_nrrd(with(lines, "space origin", "")).imported());
}

TEST(Nrrd, RefusesComponentsAndSeries) {
  Lines lines = with(small_nrrd(), "dimension", "4");
  lines = with(lines, "sizes", "3 2 2 2");
  lines = with(lines, "space directions", "none (1,0,0) (0,1,0) (0,0,1)");
  EXPECT_THAT(import_nrrd(with(lines, "kinds", "RGB-color domain domain domain")).error,
              HasSubstr("3 components"));
  EXPECT_THAT(import_with("type", "block").error, HasSubstr("block"));
}

TEST(Nrrd, OfFlatImagesInTimeIsNoVolume) {
  const auto both = [](const Lines& lines) {
    const std::string file = nrrd(lines, kSmallSamples);
    const Outcome refused = import_bytes(file);
    EXPECT_THAT(refused.error, HasSubstr("flat images of 4 x 3 samples"));
    EXPECT_EQ(refused.remedy.overridable, "frames-as-slices");
    const Outcome accepted = imported(import_bytes(file, {}, {.accept = {"frames-as-slices"}}));
    EXPECT_EQ(accepted.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
    EXPECT_THAT(codes_of(accepted), testing::Contains("frames-as-slices"));
    return accepted;
  };
  Lines lines = with(small_nrrd(), "kinds", "domain domain time");
  EXPECT_EQ(both(lines).sample_bytes(), kSmallSamples);
  lines = with(with(lines, "space directions", "(0,2,0) (0,0,3) none"), "space origin", "(7,8,9)");
  const Geometry placed = both(lines).volume.geometry;
  EXPECT_EQ(placed.spacing, (Vector3{2, 3, 1}));
  EXPECT_EQ(placed.origin, (Vector3{7, 8, 9}));
  EXPECT_EQ(placed.direction, (std::array<double, 9>{0, 0, 1, 1, 0, 0, 0, 1, 0}));
  // Sample by sample, and row by row.
  lines = with(with(lines, "sizes", "2 4 3"), "kinds", "list domain domain");
  lines = with(lines, "space directions", "none (1,0,0) (0,1,0)");
  EXPECT_EQ(both(lines).sample_bytes(), "acegikmoqsuwbdfhjlnprtvx");
  lines = with(with(lines, "sizes", "4 2 3"), "kinds", "domain list domain");
  lines = with(lines, "space directions", "(1,0,0) none (0,1,0)");
  EXPECT_EQ(both(lines).sample_bytes(), "abcdijklqrstefghmnopuvwx");
  // Images with a third axis.
  lines = with(with(small_nrrd(), "dimension", "4"), "sizes", "4 3 1 2");
  lines = with(lines, "space directions", "(1,0,0) (0,1,0) (0,0,5) none");
  EXPECT_EQ(both(with(lines, "kinds", "domain domain domain list")).volume.geometry.spacing,
            (Vector3{1, 1, 5}));
  std::string tracked = nrrd(small_nrrd(), kSmallSamples);
  tracked.insert(tracked.find("\n\n") + 1, "Seq_Frame0000_Timestamp:=1.5\n");
  EXPECT_EQ(import_bytes(tracked).remedy.overridable, "frames-as-slices");
}

TEST(Nrrd, FlatImagesAreToldByTheirAxis) {
  const Lines flat = with(small_nrrd(), "space directions", "(1,0,0) (0,1,0) none");
  const auto refused = [&](const char* kinds) { return import_nrrd(with(flat, "kinds", kinds)); };
  EXPECT_THAT(refused("domain domain time").error, HasSubstr("along its axis of time."));
  EXPECT_THAT(refused("domain domain list").error, HasSubstr("along its axis of a list."));
  Lines fourth = with(with(flat, "dimension", "4"), "sizes", "4 3 1 2");
  fourth = with(fourth, "space directions", "(1,0,0) (0,1,0) (0,0,5) none");
  EXPECT_THAT(import_nrrd(fourth).error, HasSubstr("along its axis 4, beyond the three of space."));
  const Outcome vectors = refused("domain domain vector");
  EXPECT_THAT(vectors.error, HasSubstr("flat image"));
  EXPECT_EQ(vectors.remedy.overridable, "");
  EXPECT_TRUE(vectors.remedy.choices.empty());
}

TEST(Nrrd, TakesASingleComponentForNone) {
  Lines lines = with(small_nrrd(), "dimension", "4");
  lines = with(lines, "sizes", "1 4 3 2");
  lines = with(lines, "space directions", "none (1,0,0) (0,2,0) (0,0,3)");
  const Outcome outcome =
      imported(import_nrrd(with(lines, "kinds", "vector domain domain domain")));
  EXPECT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{1, 2, 3}));
}

TEST(Nrrd, NeverReadsAnotherFile) {
  for (const char* name : {"data file", "datafile", "Data File", "DATAFILE", "data  file"}) {
    EXPECT_THAT(import_with(name, "/etc/passwd").error, HasSubstr("names the data file")) << name;
    // The lines after LIST are file names, even if they look like fields.
    EXPECT_EQ(import_with(name, "LIST").code, ErrorCode::kUnusableVolume) << name;
  }
}

TEST(Nrrd, SkipsWhatItsHeaderSays) {
  const std::string payload =
      "a line\nanother\n" + std::string(5, '#') + std::string(kSmallSamples);
  const Lines lines = with(with(small_nrrd(), "line skip", "2"), "byte skip", "5");
  EXPECT_EQ(import_nrrd(lines, payload).sample_bytes(), kSmallSamples);
  EXPECT_EQ(import_nrrd(with(small_nrrd(), "byte skip", "-1"), payload).sample_bytes(),
            kSmallSamples);
  EXPECT_FALSE(import_with("line skip", "1").imported());
  EXPECT_FALSE(import_with("line skip", "-1").imported());
  EXPECT_FALSE(import_with("byte skip", "1").imported());
  EXPECT_FALSE(import_with("byte skip", "-2").imported());
  EXPECT_FALSE(import_with("byte skip", "9223372036854775807").imported());
}

// Lines are those of the file, and bytes those of the decoded samples.
TEST(Nrrd, SkipsInItsDataFiles) {
  const std::string text = "a line\nanother\n";
  const std::string skipped = "#####" + std::string(kSmallSamples);
  Lines lines = with(with(small_nrrd(), "line skip", "2"), "byte skip", "5");
  const auto import_data = [](const Lines& header, const std::vector<std::string>& data) {
    std::vector<Member> members = {{"a.nhdr", nrrd(header, "")}};
    for (std::size_t at = 0; at < data.size(); ++at) {
      members.push_back({std::to_string(at), data[at]});
    }
    return import_bytes(zip(members));
  };
  lines = with(lines, "data file", "0");
  EXPECT_EQ(imported(import_data(lines, {text + skipped})).sample_bytes(), kSmallSamples);
  for (const std::string encoding : {"gzip", "bzip2"}) {
    const std::string packed = encoding == "gzip" ? gzip(skipped) : bzip2(skipped);
    const Lines encoded = with(lines, "encoding", encoding);
    EXPECT_EQ(imported(import_data(encoded, {text + packed})).sample_bytes(), kSmallSamples);
    EXPECT_EQ(imported(import_nrrd(with(encoded, "data file", ""), text + packed)).sample_bytes(),
              kSmallSamples);
  }
  const Lines numbers_as_text = with(with(lines, "encoding", "ascii"), "sizes", "2 2 2");
  EXPECT_EQ(imported(import_data(numbers_as_text, {text + "12345 1 2 3 4 5 6 7 8"})).sample_bytes(),
            "\1\2\3\4\5\6\7\10");
  const Lines parts = with(lines, "data file", "%d 0 1 1");
  const std::string half = text + "#####";
  EXPECT_EQ(imported(import_data(parts, {half + std::string(kSmallSamples.substr(0, 12)),
                                         half + std::string(kSmallSamples.substr(12))}))
                .sample_bytes(),
            kSmallSamples);
  // From the end, whatever the lines are.
  EXPECT_EQ(imported(import_data(with(lines, "byte skip", "-1"), {skipped})).sample_bytes(),
            kSmallSamples);
  EXPECT_THAT(import_data(lines, {"one line\n"}).error, HasSubstr("lines that its header skips"));
  EXPECT_THAT(import_data(with(lines, "byte skip", "9223372036854775807"), {text + skipped}).error,
              HasSubstr("ends before its samples begin"));
}

TEST(Nrrd, WithoutTheNameOfItsSpaceIsReadAsLpsWithANote) {
  Lines lines = with(with(small_nrrd(), "space", ""), "space dimension", "3");
  for (const Lines& each : {lines, with(small_nrrd(), "space", "scanner-xyz"),
                            with(small_nrrd(), "space", "3D-right-handed")}) {
    const Outcome outcome = imported(import_nrrd(each));
    EXPECT_EQ(outcome.volume.geometry, import_nrrd(small_nrrd()).volume.geometry);
    EXPECT_THAT(codes_of(outcome), testing::ElementsAre("space-assumed"));
  }
  EXPECT_THAT(codes_of(import_nrrd(small_nrrd())), testing::IsEmpty());
}

TEST(Nrrd, KeysMayHaveColons) {
  std::string file = nrrd(small_nrrd(), kSmallSamples);
  file.insert(file.find("type"), "foo:bar:=1\nfoo:baz:=2\ncontent: a:=b\n");
  EXPECT_EQ(import_bytes(file).error, "");
  file.insert(file.find("content"), "content: c\n");
  EXPECT_THAT(import_bytes(file).error, HasSubstr("\"content\" twice"));
}

TEST(Nrrd, RefusesHeadersThatContradictThemselves) {
  EXPECT_FALSE(import_with("dimension", "2").imported());
  EXPECT_FALSE(import_with("dimension", "17").imported());
  EXPECT_FALSE(import_with("sizes", "4 3 x").imported());
  EXPECT_FALSE(import_with("sizes", "4 3 0").imported());
  EXPECT_FALSE(import_with("sizes", "4 3 -2").imported());
  EXPECT_FALSE(import_with("sizes", "4294967295 4294967295 4294967295").imported());
  EXPECT_FALSE(import_with("type", "").imported());
  EXPECT_FALSE(import_with("encoding", "bzip2").imported());
  EXPECT_FALSE(import_with("type", "short").imported());
  EXPECT_THAT(import_bytes("NRRD0004\nno field\n\n").error, HasSubstr("no field"));
  EXPECT_THAT(import_with("content", "a\rb").error, HasSubstr("control characters"));
  EXPECT_THAT(import_bytes("NRRD0004\ntype: uint8\ntype: uint8\n\n").error, HasSubstr("twice"));
  EXPECT_THAT(import_bytes("NRRD0004\ntype: uint8\n").error, HasSubstr("has no end"));
}

// The header limits how much may be unpacked, not the general size limit.
TEST(Nrrd, InsideGzipItMayBeAsLargeAsItsHeaderTells) {
  const Lines text = with(small_nrrd(), "encoding", "ascii");
  EXPECT_THAT(import_bytes(gzip(nrrd(text, std::string(10'000'000, ' ')))).error,
              HasSubstr("The compressed file unpacks to more than"));
  const std::string skipped(100'000, '\n');
  EXPECT_EQ(import_bytes(gzip(nrrd(with(small_nrrd(), "line skip", "100000"),
                                   skipped + std::string(kSmallSamples))))
                .error,
            "");
}

// Each line was looked for in a block of its own.
TEST(Nrrd, SkipsManyLines) {
  const auto with_lines = [](std::size_t lines) {
    return import_nrrd(with(small_nrrd(), "line skip", "1000000"),
                       std::string(lines, '\n') + std::string(kSmallSamples));
  };
  EXPECT_EQ(with_lines(1'000'000).error, "");
  EXPECT_THAT(with_lines(1000).error, HasSubstr("lines that its header skips"));
}

TEST(Nrrd, FieldsOfManyNumbersAreRefused) {
  std::string many;
  for (int n = 0; n < 500; ++n) many += "1 ";
  for (const std::string field :
       {"sizes", "spacings", "axis mins", "space directions", "space origin"}) {
    EXPECT_EQ(import_with(field, many).code, ErrorCode::kUnusableVolume) << field;
  }
}

TEST(Nrrd, RefusesTextThatIsNotItsSamples) {
  const Lines lines = with(with(small_nrrd(), "encoding", "ascii"), "sizes", "2 2 2");
  const std::string six = "0 0 0 0 0 0 ";
  EXPECT_TRUE(import_nrrd(lines, six + "1 2").imported());
  EXPECT_TRUE(import_nrrd(lines, six + "\n 1,\n 2 \n").imported());
  for (const char* text : {"", "1", "1 2 3", "1 x", "1 256", "1 -1", "1 2.5", "1 nan", "1,2"}) {
    EXPECT_EQ(import_nrrd(lines, six + text).code, ErrorCode::kUnusableVolume) << text;
  }
  EXPECT_FALSE(import_nrrd(lines, std::string(1 << 20, '1')).imported());
  const Lines hex_lines = with(lines, "encoding", "hex");
  EXPECT_TRUE(import_nrrd(hex_lines, "000000000000 0 1\nfF").imported());
  for (const char* text : {"", "00", "00 f", "000000", "00 0g"}) {
    EXPECT_EQ(import_nrrd(hex_lines, "000000000000" + std::string(text)).code,
              ErrorCode::kUnusableVolume)
        << text;
  }
}

}  // namespace
}  // namespace isomesh::import::test
