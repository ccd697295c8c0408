// One object, stored with its axes in any order and from either end, is one canonical file.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/samples/wide_labels.h"
#include "server/volume/geometry.h"
#include "server/volume/sample_order.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using volume::AxisOrder;
using Dims = std::array<std::uint32_t, 3>;

constexpr Dims kDims = {5, 4, 3};
constexpr std::size_t kCount = 60;
const Geometry kPlace = {.origin = {-50.3, 12.25, 7}, .spacing = {0.7, 0.8, 1.5}};

// Reversals, exchanges of two axes, and turns of all three.
const std::vector<AxisOrder> kStorages = {{1, 2, 3},   {-1, -2, 3}, {1, 2, -3}, {2, 1, 3},
                                          {-1, 3, -2}, {3, 1, 2},   {2, -3, 1}, {-3, -2, -1}};

template <class Sample>
constexpr const char* name_of() {
  constexpr bool kSigned = std::is_signed_v<Sample>;
  if constexpr (std::is_floating_point_v<Sample>) return sizeof(Sample) == 4 ? "float" : "double";
  if constexpr (sizeof(Sample) == 1) return kSigned ? "int8" : "uint8";
  if constexpr (sizeof(Sample) == 2) return kSigned ? "int16" : "uint16";
  if constexpr (sizeof(Sample) == 4) return kSigned ? "int32" : "uint32";
  return kSigned ? "int64" : "uint64";
}

std::string tuple(const volume::Vector3& numbers) {
  std::ostringstream text;
  text.precision(17);
  text << '(' << numbers[0] << ',' << numbers[1] << ',' << numbers[2] << ')';
  return text.str();
}

// The lines of a NRRD file with that lattice.
Lines header(const Dims& dims, const Geometry& geometry, const std::string& type) {
  std::string sizes;
  std::string steps;
  for (int axis = 0; axis < 3; ++axis) {
    const char* const space = axis == 0 ? "" : " ";
    sizes += space + std::to_string(dims[static_cast<std::size_t>(axis)]);
    steps += space + tuple(volume::step_of(geometry, axis));
  }
  Lines lines = with(with(small_nrrd(), "type", type), "sizes", sizes);
  lines = with(with(lines, "endian", "little"), "space directions", steps);
  return with(lines, "space origin", tuple(geometry.origin));
}

template <class Sample>
std::vector<Sample> in_order(std::vector<Sample> samples, const AxisOrder& order,
                             const Dims& dims = kDims) {
  volume::put_in_order(std::as_writable_bytes(std::span(samples)), sizeof(Sample), dims, order);
  return samples;
}

template <class Sample>
std::string stored(const std::vector<Sample>& samples, const AxisOrder& order,
                   const Geometry& place = kPlace) {
  return nrrd(header(volume::in_order(kDims, order), volume::in_order(kDims, place, order),
                     name_of<Sample>()),
              bytes_of(in_order(samples, order)));
}

template <class Sample>
void expect_one_file(const std::vector<Sample>& samples) {
  const Outcome expected = imported(import_bytes(stored(samples, volume::kFilesOrder)));
  EXPECT_EQ(expected.volume.geometry, kPlace);
  for (const AxisOrder& order : kStorages) {
    const Outcome outcome = imported(import_bytes(stored(samples, order)));
    EXPECT_EQ(outcome.stored, expected.stored) << name_of<Sample>() << volume::to_string(order);
    EXPECT_EQ(outcome.volume.range, expected.volume.range);
    EXPECT_EQ(outcome.volume.suggested_iso, expected.volume.suggested_iso);
    EXPECT_EQ(outcome.volume.labels, expected.volume.labels);
    EXPECT_EQ(outcome.volume.notes, expected.volume.notes);
  }
}

TEST(AxisOrder, OfSamplesOfAllTypesIsThatOfThePatient) {
  expect_one_file(some_samples<std::uint8_t>(kCount));
  expect_one_file(some_samples<std::int8_t>(kCount));
  expect_one_file(some_samples<std::uint16_t>(kCount));
  expect_one_file(some_samples<std::int16_t>(kCount));
  expect_one_file(some_samples<std::uint32_t>(kCount));
  expect_one_file(some_samples<std::int32_t>(kCount));
  expect_one_file(some_samples<float>(kCount));
  expect_one_file(some_samples<double>(kCount));
}

TEST(AxisOrder, OfSamplesThatAreConvertedIsThatOfThePatient) {
  std::vector<float> gaps = some_samples<float>(kCount);
  gaps[7] = std::numeric_limits<float>::quiet_NaN();
  expect_one_file(gaps);
  std::vector<std::int64_t> labels(kCount, 0);
  std::fill(labels.begin() + 20, labels.begin() + 40, std::int64_t{1} << 40);
  std::fill(labels.begin() + 40, labels.end(), std::int64_t{3} << 40);
  expect_one_file(labels);
  std::vector<float> masks(kCount, 0);
  std::fill(masks.begin() + 20, masks.begin() + 33, 1.0F);
  expect_one_file(masks);
}

// Regions count along the first axis of the patient. Samples that are no labels are not written
// before that is known.
TEST(AxisOrder, OfWideIntegersDoesNotDecideIfTheyAreLabels) {
  const Folder folder;
  for (const bool are_flat : {true, false}) {
    std::vector<std::int64_t> samples;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 4; ++j) {
        for (int i = 0; i < 5; ++i) {
          samples.push_back(std::int64_t{(are_flat ? 3 * k + j : 3 * i + j) % 5 + 1} << 40);
        }
      }
    }
    for (const AxisOrder& order : kStorages) {
      const InputFile file(folder.write("samples", bytes_of(in_order(samples, order))));
      const std::filesystem::path target = folder.path("target");
      Volume volume;
      volume.dims = volume::in_order(kDims, order);
      volume.geometry = volume::in_order(kDims, kPlace, order);
      SampleLayout layout;
      layout.type = StoredType::kInt64;
      ImportTask task;
      task.target = target;
      const auto labels = write_wide_labels({.file = file, .layout = layout}, volume, task);
      EXPECT_EQ(labels.has_value(), are_flat) << volume::to_string(order);
      EXPECT_EQ(std::filesystem::exists(target), are_flat) << volume::to_string(order);
      std::filesystem::remove(target);
    }
  }
}

TEST(AxisOrder, InTheFileIsTold) {
  const std::vector<std::uint8_t> samples = some_samples<std::uint8_t>(kCount);
  const auto told = [&](const AxisOrder& order) {
    return imported(import_bytes(stored(samples, order))).volume.stored_axes;
  };
  EXPECT_EQ(told({1, 2, 3}), "LPS");
  EXPECT_EQ(told({-1, -2, 3}), "RAS");
  EXPECT_EQ(told({3, 1, -2}), "SLA");
  EXPECT_EQ(imported(import_bytes(nifti({}, kSmallSamples))).volume.stored_axes, "RAS");
}

// MIF and Fortran's arrays have the samples of x, y and z in another order in the file.
TEST(AxisOrder, OfAnArrayInFortransOrderIsThatOfItsIndices) {
  const auto npy = [](const char* is_fortran, const std::string& samples) {
    std::string header =
        "{'descr': '|u1', 'fortran_order': " + std::string(is_fortran) + ", 'shape': (2, 3, 4), }";
    header.resize(117, ' ');
    return std::string("\x93NUMPY\x01\x00", 8) + std::string("\x76\x00", 2) + header + '\n' +
           samples;
  };
  const ImportOptions options = {.spacing = volume::Vector3{1, 2, 3}};
  const std::string samples(kSmallSamples);
  const Outcome c = imported(import_bytes(npy("False", samples), {}, options));
  const std::string turned = [&] {
    std::vector<char> bytes(samples.begin(), samples.end());
    bytes = in_order(bytes, {3, 2, 1}, {4, 3, 2});
    return std::string(bytes.begin(), bytes.end());
  }();
  const Outcome fortran = imported(import_bytes(npy("True", turned), {}, options));
  EXPECT_EQ(fortran.stored, c.stored);
  EXPECT_EQ(fortran.volume.stored_axes, c.volume.stored_axes);
  EXPECT_EQ(c.volume.geometry.spacing, (volume::Vector3{1, 2, 3}));
  EXPECT_EQ(c.sample_bytes(), samples);
}

TEST(AxisOrder, OfARawDescriptionIsItsOwn) {
  const std::vector<std::uint8_t> samples = some_samples<std::uint8_t>(kCount);
  const auto raw = [&](const AxisOrder& order) {
    const RawDescription description = {.dims = volume::in_order(kDims, order),
                                        .type = SampleType::kUint8,
                                        .geometry = volume::in_order(kDims, kPlace, order)};
    return imported(import_raw_bytes(bytes_of(in_order(samples, order)), description));
  };
  for (const AxisOrder& order : kStorages) {
    EXPECT_EQ(raw(order).stored, raw(volume::kFilesOrder).stored) << volume::to_string(order);
  }
}

// The request speaks of the axes of the file.
TEST(AxisOrder, OfASpacingIsThatOfTheFile) {
  Lines lines = header({5, 4, 3}, {.direction = {0, 0, 1, 1, 0, 0, 0, 1, 0}}, "uint8");
  lines = with(with(lines, "space directions", ""), "space origin", "");
  lines = with(with(lines, "space", ""), "space", "");
  const Outcome outcome = import_bytes(nrrd(lines, bytes_of(some_samples<std::uint8_t>(kCount))),
                                       {}, {.spacing = volume::Vector3{1, 2, 3}});
  EXPECT_EQ(imported(outcome).volume.geometry.spacing, (volume::Vector3{1, 2, 3}));
}

std::string with_keys(std::string file, const std::string& keys) {
  return file.insert(file.find("\n\n") + 1, keys);
}

// Combinations of segments are numbered by their labels, and planes are added at the same ends.
TEST(AxisOrder, OfLayersOfASegmentationIsThatOfThePatient) {
  std::vector<std::uint8_t> layers[3];
  for (std::vector<std::uint8_t>& layer : layers) layer.resize(kCount);
  for (std::size_t at = 0; at < kCount; ++at) {
    layers[0][at] = at % 3 == 0;
    layers[1][at] = at % 5 < 2;
    layers[2][at] = at > 30 && at % 7 < 3;
  }
  std::string keys;
  for (const std::string at : {"0", "1", "2"}) {
    keys += "Segment" + at + "_Name:=part " + at + "\nSegment" + at + "_LabelValue:=1\nSegment" +
            at + "_Layer:=" + at + '\n';
  }
  const auto segmentation = [&](const AxisOrder& order) {
    const Dims dims = volume::in_order(kDims, order);
    Lines lines = header(dims, volume::in_order(kDims, kPlace, order), "uint8");
    const auto change = [&](const std::string& name, const std::string& more) {
      const auto line = std::ranges::find(lines, name, &std::pair<std::string, std::string>::first);
      line->second += more;
    };
    change("sizes", " 3");
    change("space directions", " none");
    lines = with(with(lines, "dimension", "4"), "kinds", "domain domain domain list");
    std::string samples;
    for (const auto& layer : layers) samples += bytes_of(in_order(layer, order));
    return imported(import_bytes(with_keys(nrrd(lines, samples), keys)));
  };
  const Outcome expected = segmentation(volume::kFilesOrder);
  EXPECT_THAT(codes_of(expected), testing::Contains("overlapping-segments"));
  EXPECT_THAT(codes_of(expected), testing::Contains("empty-planes"));
  for (const AxisOrder& order : kStorages) {
    const Outcome outcome = segmentation(order);
    EXPECT_EQ(outcome.stored, expected.stored) << volume::to_string(order);
    EXPECT_EQ(outcome.volume.labels, expected.volume.labels) << volume::to_string(order);
  }
}

// Masks of one grid fit together in whatever order each of them is stored.
TEST(AxisOrder, OfMasksMayDiffer) {
  std::vector<std::uint8_t> liver(kCount);
  std::vector<std::uint8_t> spleen(kCount);
  for (std::size_t at = 0; at < kCount; ++at) {
    liver[at] = at % 4 == 1;
    spleen[at] = at % 5 < 2;
  }
  const auto both = [&](const AxisOrder& one, const AxisOrder& other) {
    return imported(import_bytes(
        tar({{"liver.nrrd", stored(liver, one)}, {"spleen.nrrd", stored(spleen, other)}}), {},
        {.masks = true}));
  };
  const Outcome expected = both(volume::kFilesOrder, volume::kFilesOrder);
  for (const AxisOrder& order : kStorages) {
    EXPECT_EQ(both(order, {3, -1, 2}).stored, expected.stored) << volume::to_string(order);
    EXPECT_EQ(both(order, {3, -1, 2}).volume.labels, expected.volume.labels);
  }
  EXPECT_EQ(both({-1, -2, 3}, {3, -1, 2}).volume.stored_axes, "RAS");
}

TEST(AxisOrder, OfEachTimePointIsThatOfThePatient) {
  const auto samples = some_samples<std::int16_t>(2 * kCount);
  const auto time = [&](std::uint32_t at, const AxisOrder& order) {
    Lines lines =
        header(volume::in_order(kDims, order), volume::in_order(kDims, kPlace, order), "int16");
    for (auto& [name, value] : lines) {
      if (name == "sizes") value += " 2";
      if (name == "space directions") value += " none";
    }
    lines = with(with(lines, "dimension", "4"), "kinds", "domain domain domain time");
    std::string bytes;
    for (const std::ptrdiff_t first : {0, 60}) {
      const std::vector<std::int16_t> one(samples.begin() + first, samples.begin() + first + 60);
      bytes += bytes_of(in_order(one, order));
    }
    return imported(import_bytes(nrrd(lines, bytes), {}, {.volume = at}));
  };
  for (const AxisOrder& order : kStorages) {
    for (const std::uint32_t at : {0U, 1U}) {
      EXPECT_EQ(time(at, order).stored, time(at, volume::kFilesOrder).stored)
          << volume::to_string(order);
    }
  }
}

}  // namespace
}  // namespace isomesh::import::test
