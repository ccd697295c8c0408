// Units of length that headers give in words.
#include "server/import/source/units.h"

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/hdf5_writer.h"
#include "tests/unit/import/writers.h"
#include "tests/unit/import/zarr_files.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

// https://ngff.openmicroscopy.org/0.4/#axes-md
TEST(Units, OfTheListOfOmeZarrAreKnown) {
  const std::map<std::string, double> list = {
      {"angstrom", 1e-7},    {"attometer", 1e-15},  {"centimeter", 10},
      {"decimeter", 100},    {"exameter", 1e21},    {"femtometer", 1e-12},
      {"foot", 304.8},       {"gigameter", 1e12},   {"hectometer", 1e5},
      {"inch", 25.4},        {"kilometer", 1e6},    {"megameter", 1e9},
      {"meter", 1000},       {"micrometer", 0.001}, {"mile", 1609344},
      {"millimeter", 1},     {"nanometer", 1e-6},   {"parsec", 3.0856775814913673e19},
      {"petameter", 1e18},   {"picometer", 1e-9},   {"terameter", 1e15},
      {"yard", 914.4},       {"yoctometer", 1e-21}, {"yottameter", 1e27},
      {"zeptometer", 1e-18}, {"zettameter", 1e24}};
  EXPECT_EQ(list.size(), 26);
  for (const auto& [name, length] : list) EXPECT_EQ(millimetres_of(name), length) << name;
}

// https://www.openmicroscopy.org/Schemas/OME/2016-06/ome.xsd, UnitsLength
TEST(Units, OfTheListOfOmeXmlAreKnown) {
  for (const char* symbol :
       {"Ym",   "Zm", "Em", "Pm",      "Tm", "Gm", "Mm", "km", "hm", "dam", "m",
        "dm",   "cm", "mm", "\u00b5m", "nm", "pm", "fm", "am", "zm", "ym",  "\u00c5",
        "thou", "li", "in", "ft",      "yd", "mi", "ua", "ly", "pc", "pt"}) {
    EXPECT_TRUE(millimetres_of(symbol)) << symbol;
  }
}

TEST(Units, CaseMattersOnlyWhereSymbolsDifferInNothingElse) {
  EXPECT_EQ(millimetres_of("Mm"), 1e9);
  EXPECT_EQ(millimetres_of("mm"), 1);
  EXPECT_EQ(millimetres_of("Pm"), 1e18);
  EXPECT_EQ(millimetres_of("pm"), 1e-9);
  EXPECT_EQ(millimetres_of(" MM "), 1);
  EXPECT_EQ(millimetres_of("UM"), 0.001);
  EXPECT_EQ(millimetres_of("Micrometres"), 0.001);
  EXPECT_EQ(millimetres_of("INCHES"), 25.4);
  EXPECT_EQ(millimetres_of("microns"), 0.001);
  for (const char* none : {"", "?", "s", "pixel", "furlong", "ppm", "reference frame", "mmm"}) {
    EXPECT_FALSE(millimetres_of(none)) << none;
  }
}

// A small file of a format that names units in words, with a spacing of 2 and its first sample 8
// units from the origin of space along x.
struct Named {
  const char* format;
  std::function<std::string(const std::string& unit)> file;
};

std::vector<Named> formats_with_units() {
  const std::string samples(kSmallSamples);
  return {
      {"nrrd",
       [=](const std::string& unit) {
         Lines lines = with(with(small_nrrd(), "space directions", "(2,0,0) (0,2,0) (0,0,2)"),
                            "space origin", "(8,0,0)");
         const std::string quoted = '"' + unit + '"';
         lines.emplace_back("space units", quoted + ' ' + quoted + ' ' + quoted);
         return nrrd(lines, samples);
       }},
      {"metaimage",
       [=](const std::string& unit) {
         Lines lines = with(with(small_metaimage(), "ElementSpacing", "2 2 2"), "Offset", "8 0 0");
         lines.insert(lines.begin() + 3, {"DistanceUnits", unit});
         return metaimage(lines, samples);
       }},
      {"zarr", [](const std::string& unit) {
         using namespace zarr;
         return zip(zarr_2(
             array_2("null"), plain,
             multiscales(axis("z", unit) + "," + axis("y", unit) + "," + axis("x", unit),
                         "[2, 2, 2]", R"(}, {"type": "translation", "translation": [0, 0, 8])")));
       }}};
}

TEST(Units, ThatAreUnknownNeedASpacing) {
  const ImportOptions given = {.spacing = Vector3{0.5, 1, 2}};
  for (const auto& [format, file] : formats_with_units()) {
    SCOPED_TRACE(format);
    const Outcome refused = import_bytes(file("furlong"));
    EXPECT_THAT(refused.error, HasSubstr("unit of length \"furlong\" is unknown"));
    ASSERT_EQ(refused.remedy.choices.size(), 1);
    EXPECT_EQ(refused.remedy.choices[0].parameter, "spacing");
    EXPECT_EQ(refused.remedy.choices[0].value, "2,2,2");
    for (const std::string unit : {"furlong", "pixel"}) {
      const Outcome placed = imported(import_bytes(file(unit), {}, given));
      EXPECT_EQ(placed.volume.geometry.spacing, (Vector3{0.5, 1, 2})) << unit;
      EXPECT_EQ(placed.volume.geometry.origin, (Vector3{2, 0, 0})) << unit;
      EXPECT_THAT(codes_of(placed), Not(Contains("unit-unknown"))) << unit;
    }
    const Outcome pixels = imported(import_bytes(file("pixel")));
    EXPECT_EQ(pixels.volume.geometry.origin, (Vector3{8, 0, 0}));
    EXPECT_THAT(codes_of(pixels), Contains("unit-unknown"));
    EXPECT_EQ(import_bytes(file("mm"), {}, given).code, ErrorCode::kInvalidParameter);
    EXPECT_EQ(imported(import_bytes(file("inch"))).volume.geometry.spacing,
              (Vector3{50.8, 50.8, 50.8}));
  }
}

// Lengths of molecules and stars are none of a volume, but the request may give others.
TEST(Units, ThatAreTooSmallOrTooLargeNeedASpacing) {
  const ImportOptions given = {.spacing = Vector3{0.5, 1, 2}};
  for (const auto& [format, file] : formats_with_units()) {
    for (const std::string unit : {"picometer", "parsec"}) {
      SCOPED_TRACE(format + (' ' + unit));
      const Outcome refused = import_bytes(file(unit));
      EXPECT_THAT(refused.error, HasSubstr("not between a millionth and a million"));
      EXPECT_EQ(refused.remedy.choices.at(0).value, "1,1,1");
      const Outcome placed = imported(import_bytes(file(unit), {}, given));
      EXPECT_EQ(placed.volume.geometry.spacing, (Vector3{0.5, 1, 2}));
      EXPECT_DOUBLE_EQ(placed.volume.geometry.origin[0], 2);
    }
  }
}

TEST(Units, OfMincThatAreUnknownNeedASpacing) {
  const Hdf5Image image = {.samples = std::vector<std::int16_t>(24)};
  const std::string file = minc({.units = "furlong"}, image);
  EXPECT_EQ(import_bytes(file).remedy.choices.at(0).value, "1,2,3");
  const Outcome placed = imported(import_bytes(file, {}, {.spacing = Vector3{2, 4, 6}}));
  EXPECT_EQ(placed.volume.geometry.spacing, (Vector3{2, 4, 6}));
  EXPECT_EQ(placed.volume.geometry.origin, (Vector3{-10, -12, 14}));
}

}  // namespace
}  // namespace isomesh::import::test
