// Label volumes on the grid of a series, and the segmentations made from them.
#include "server/hospital/objects/segmentation.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "proto/samples.h"
#include "server/hospital/orders/label_grid.h"
#include "server/volume/canonical.h"
#include "tests/support/errors.h"
#include "tests/support/storages.h"
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

using dicom::SegmentationFrame;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

constexpr std::array<std::uint32_t, 3> kSizes = {3, 2, 2};

// Images with steps of 1, 2 and 3 mm from (-5, 4, 7).
const Geometry kImages = {.origin = {-5, 4, 7}, .spacing = {1, 2, 3}};

Volume label_volume() {
  Volume labels;
  labels.id = "labels";
  labels.samples = "labels";
  labels.dims = kSizes;
  labels.geometry = kImages;
  labels.dicom.reset();
  return labels;
}

// The same places, but rows and slices go the other way, as in a NIfTI.
Geometry flipped() {
  Geometry geometry = kImages;
  geometry.origin = {-5, 4 + 2, 7 + 3};
  geometry.direction = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  return geometry;
}

std::string reason_of(const Volume& labels) {
  return test::error_of([&] { label_grid(kImages, kSizes, labels); }).what();
}

TEST(LabelGridTest, IsThatOfTheImages) {
  Volume labels = label_volume();
  EXPECT_THAT(label_grid(kImages, kSizes, labels).is_flipped, ElementsAre(false, false, false));
  labels.geometry = flipped();
  EXPECT_THAT(label_grid(kImages, kSizes, labels).is_flipped, ElementsAre(false, true, true));
  // As much as headers with single precision are off.
  labels.geometry.origin[0] += 1e-4;
  label_grid(kImages, kSizes, labels);
}

TEST(LabelGridTest, OfAnotherPlaceDoesNotFit) {
  Volume labels = label_volume();
  labels.dims[2] = 3;
  EXPECT_THAT(reason_of(labels), HasSubstr("other sizes"));
  labels = label_volume();
  labels.geometry.origin[1] += 0.2;
  EXPECT_THAT(reason_of(labels), HasSubstr("not at the places"));
  labels = label_volume();
  labels.geometry.spacing[2] = 3.5;
  EXPECT_THAT(reason_of(labels), HasSubstr("not at the places"));
  labels = label_volume();
  labels.geometry.direction = {0, 1, 0, 1, 0, 0, 0, 0, 1};
  EXPECT_THAT(reason_of(labels), HasSubstr("other sizes"));
  labels.dims = {2, 3, 2};
  EXPECT_THAT(reason_of(labels), HasSubstr("not at the places"));
  labels = label_volume();
  labels.labels = {{.label = 1, .values = {1, 3}}};
  EXPECT_THAT(reason_of(labels), HasSubstr("share"));
}

// A series of sagittal images has other axes than its volume.
TEST(ImagesOf, AVolumeHaveTheOrderOfTheFile) {
  const test::SampleVolume<std::uint8_t> volume = {
      .samples = std::vector<std::uint8_t>(2 * 3 * 4), .dims = {2, 3, 4}, .geometry = kImages};
  for (const test::Storage& storage : test::all_storages()) {
    Volume series;
    series.dims = {2, 3, 4};
    series.geometry = kImages;
    std::string codes;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      codes += (storage.is_reversed[axis] ? "RAI" : "LPS")[storage.axes[axis]];
    }
    series.stored_axes = codes;
    const ImageLattice images = images_of(series);
    const auto stored = stored_as(volume, storage);
    EXPECT_THAT(images.dims, ElementsAre(stored.dims.x, stored.dims.y, stored.dims.z));
    EXPECT_EQ(images.geometry, stored.geometry) << codes;
  }
  Volume old;
  old.dims = kSizes;
  old.geometry = flipped();
  EXPECT_EQ(images_of(old).geometry, flipped());
}

class SegmentationTest : public OrdersTest {
 protected:
  template <class Sample>
  LabelGrid grid_of(const std::vector<Sample>& samples, const Geometry& geometry,
                    const Geometry& images = kImages,
                    const std::array<std::uint32_t, 3>& sizes = kSizes,
                    const std::array<std::uint32_t, 3>& stored_sizes = kSizes) {
    Volume labels = label_volume();
    labels.dims = stored_sizes;
    labels.type = sample_type<Sample>();
    labels.geometry = geometry;
    std::string file(volume::kHeaderBytes, ' ');
    file.resize(file.size() + samples.size() * sizeof(Sample));
    std::memcpy(file.data() + volume::kHeaderBytes, samples.data(),
                samples.size() * sizeof(Sample));
    labels.samples = test::put(blobs_, file).key;
    return label_grid(images, sizes, labels);
  }

  // The frames, and then the bits.
  std::string bits_of(const LabelGrid& grid, const std::vector<std::int64_t>& labels) {
    const auto frames = frames_of(grid, labels, blobs_, {});
    std::string text;
    for (const SegmentationFrame& frame : frames) {
      text += std::to_string(frame.segment) + '@' + std::to_string(frame.slice) + ' ';
    }
    write_frames(grid, labels, frames, blobs_, {}, [&](std::span<const std::byte> bytes) {
      for (const std::byte byte : bytes) {
        for (int bit = 0; bit < 8; ++bit)
          text += (static_cast<int>(byte) >> bit & 1) != 0 ? '1' : '.';
      }
    });
    return text;
  }
};

TEST_F(SegmentationTest, HasABitForEachSampleAndSegment) {
  const std::vector<std::uint16_t> samples = {0, 7, 7, 300, 0, 0,  //
                                              0, 0, 0, 300, 7, 0};
  const LabelGrid grid = grid_of(samples, kImages);
  // Three samples in each of two rows, four frames of six bits, and a byte that makes it even.
  EXPECT_EQ(bits_of(grid, {7, 300}),
            "1@0 1@1 2@0 2@1 .11.......1....1.....1.."
            "........");
  EXPECT_EQ(bits_of(grid, {300}), "1@0 1@1 ...1.....1......");
  EXPECT_EQ(bits_of(grid, {8}), "");
}

// 0 is a label like others if a job has another background.
TEST_F(SegmentationTest, HasSlicesThatAreWhollyOneLabel) {
  const std::vector<std::uint8_t> samples = {0, 0, 0, 0, 0, 0,  //
                                             5, 5, 5, 5, 5, 5};
  EXPECT_EQ(bits_of(grid_of(samples, kImages), {0, 5}), "1@0 2@1 111111111111....");
}

TEST_F(SegmentationTest, HasTheOrderOfTheImages) {
  const std::vector<float> samples = {0, 1, 1, 2, 0, 0.4F,  //
                                      0, 0, 0, 2, 1, 0};
  // The last slice and the last row come first.
  EXPECT_EQ(bits_of(grid_of(samples, flipped()), {1, 2}),
            "1@0 1@1 2@0 2@1 .1........111.....1....."
            "........");
}

// Volumes are stored along the patient's axes, whatever the rows and columns of their images are.
TEST_F(SegmentationTest, HasTheOrderOfTheImagesHoweverTheLabelsAreStored) {
  test::SampleVolume<std::uint8_t> labels = {
      .samples = {}, .dims = {3, 4, 5}, .geometry = test::oblique_geometry()};
  for (int n = 0; n < 3 * 4 * 5; ++n) labels.samples.push_back(n * 7 % 11 / 3);
  const std::array<std::uint32_t, 3> sizes = {3, 4, 5};
  std::string expected;
  for (const test::Storage& storage : test::all_storages()) {
    const auto stored = stored_as(labels, storage);
    const LabelGrid grid = grid_of(stored.samples, stored.geometry, labels.geometry, sizes,
                                   {stored.dims.x, stored.dims.y, stored.dims.z});
    const std::string bits = bits_of(grid, {1, 2, 3});
    if (expected.empty()) expected = bits;
    EXPECT_EQ(bits, expected);
  }
  EXPECT_THAT(expected, HasSubstr("3@4 "));
}

// The frames of a window of slices come together, so that it is read once for all segments.
TEST_F(SegmentationTest, OfSlicesAcrossTheFileGoesOnFromWindowToWindow) {
  test::SampleVolume<std::uint8_t> labels = {.samples = {}, .dims = {3, 2, 5}, .geometry = {}};
  for (int n = 0; n < 3 * 2 * 5; ++n) labels.samples.push_back(n % 2 + 1);
  const std::array<std::uint32_t, 3> sizes = {3, 2, 5};
  int across = 0;
  for (const test::Storage& storage : test::all_storages()) {
    const auto stored = stored_as(labels, storage);
    LabelGrid grid = grid_of(stored.samples, stored.geometry, labels.geometry, sizes,
                             {stored.dims.x, stored.dims.y, stored.dims.z});
    grid.window_bytes = 13;  // two slices
    if (grid.axes[2] == 2) continue;
    ++across;
    EXPECT_THAT(bits_of(grid, {1, 2}), StartsWith("1@0 1@1 2@0 2@1 1@2 1@3 2@2 2@3 1@4 2@4 "
                                                  "1.1.1.1.1.1..1.1.1.1.1.1"));
  }
  EXPECT_EQ(across, 32);
}

// The bytes that this process has read with system calls.
std::uint64_t bytes_read() {
  std::ifstream file("/proc/self/io");
  std::string name;
  std::uint64_t bytes = 0;
  file >> name >> bytes;
  EXPECT_EQ(name, "rchar:");
  return bytes;
}

// Sagittal images: each row of the file has a sample of each slice.
TEST_F(SegmentationTest, OfSlicesAcrossTheRowsOfTheFileAreFoundInOnePass) {
  test::SampleVolume<std::uint8_t> labels = {.samples = {}, .dims = {64, 50, 60}, .geometry = {}};
  for (int n = 0; n < 64 * 50 * 60; ++n) labels.samples.push_back(n % 64 / 16);
  const auto stored = stored_as(labels, {.axes = {1, 2, 0}, .is_reversed = {}});
  LabelGrid grid = grid_of(labels.samples, labels.geometry, stored.geometry,
                           {stored.dims.x, stored.dims.y, stored.dims.z}, {64, 50, 60});
  ASSERT_EQ(grid.axes[2], 0U);
  grid.window_bytes = 1;  // a slice
  const std::uint64_t before = bytes_read();
  const std::vector<std::int64_t> wanted = {1, 2, 3};
  EXPECT_EQ(frames_of(grid, wanted, blobs_, {}).size(), 48U);
  EXPECT_LT(bytes_read() - before, 2 * labels.samples.size());
}

// They are counted before they are all in memory: noise has most labels in each slice.
TEST_F(SegmentationTest, OfTooManyFramesIsRefusedWhileTheyAreCounted) {
  constexpr std::uint32_t kSide = 256;
  LabelGrid grid = grid_of(std::vector<std::uint16_t>(kSizes[0] * kSizes[1] * kSizes[2]), kImages);
  grid.dims = {kSide, kSide, 2};
  std::string file(volume::kHeaderBytes, ' ');
  std::vector<std::int64_t> labels;
  for (std::uint32_t slice = 0; slice < 2; ++slice) {
    for (std::uint32_t label = 0; label < kSide * kSide; ++label) {
      file += static_cast<char>(label & 0xff);
      file += static_cast<char>(label >> 8);
      if (slice == 0) labels.push_back(label);
    }
  }
  grid.samples = test::put(blobs_, file).key;
  EXPECT_EQ(test::code_thrown_by([&] { frames_of(grid, labels, blobs_, {}); }),
            ErrorCode::kTooLarge);
}

TEST(SegmentationHead, DescribesSegmentsAndFrames) {
  DicomIdentity identity;
  identity.study_uid = "1.2";
  identity.series_uid = "1.3";
  identity.instances = {{"1.2.840.10008.5.1.4.1.1.2", "1.5.1"},
                        {"1.2.840.10008.5.1.4.1.1.2", "1.5.2"}};
  dicom::SegmentationObject object = {
      .common = {.identity = identity,
                 .sop_instance_uid = "2.25.2",
                 .series_uid = "2.25.1",
                 .title = "Organs",
                 .made = {},
                 .station_name = "here"},
      .dims = kSizes,
      .origin = kImages.origin,
      .steps = {{{1, 0, 0}, {0, 2, 0}, {0, 0, 3}}},
      .segments = {{.label = 7, .name = "Liver", .color = "#ff0000"}},
      .frames = {{.segment = 1, .slice = 1}}};
  const std::string head = dicom::segmentation_head(object);
  for (const char* text : {"Liver", "label 7", "BINARY", "2\\1", "-5\\4\\10", "1\\0\\0\\0\\1\\0"}) {
    EXPECT_THAT(head, HasSubstr(text));
  }
  EXPECT_EQ(dicom::segmentation_pixel_bytes(object), 2U);
  object.frames.resize(dicom::kMostFrames + 1);
  EXPECT_EQ(test::error_of([&] { dicom::segmentation_head(object); }).code(), ErrorCode::kTooLarge);
}

// Reference values for D50.
TEST(SegmentationHead, HasColorsInCielab) {
  EXPECT_THAT(dicom::cielab_of("#ffffff"), ElementsAre(65535, 32896, 32896));
  EXPECT_THAT(dicom::cielab_of("#000000"), ElementsAre(0, 32896, 32896));
  const auto red = dicom::cielab_of("#ff0000");
  EXPECT_NEAR(red[0], 54.29 / 100 * 65535, 20);
  EXPECT_NEAR(red[1], (80.81 + 128) / 255 * 65535, 20);
  EXPECT_NEAR(red[2], (69.89 + 128) / 255 * 65535, 20);
}

class LabelVolumeOrders : public OrdersTest {
 protected:
  static OrderRequest request() {
    OrderRequest request;
    request.source = {.pacs = "main", .study = kStudy, .series = kSeries};
    request.parameters = R"({"labels": "all"})";
    request.send = {{.pacs = "main", .format = SendFormat::kSeg}};
    request.label_volume = "labels";
    return request;
  }
  std::string refused(const OrderRequest& request) {
    const Error error = test::error_of([&] { submit(request); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    return error.fields().empty() ? "" : error.fields().front().field;
  }
};

// Rows lead to the back, columns to the feet; three rows of five. The slices are 1 mm apart.
std::string sagittal_file(int slice) {
  return test::dicom(
      element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.4") +
      element(8, 0x18, "UI", instance_of(slice)) + element(8, 0x60, "CS", "MR") +
      element(0x10, 0x20, "LO", "PAT-1") + element(0x20, 0xD, "UI", kStudy) +
      element(0x20, 0xE, "UI", kSeries) + element(0x20, 0x13, "IS", std::to_string(slice + 1)) +
      element(0x20, 0x32, "DS", std::to_string(slice) + "\\0\\10") +
      element(0x20, 0x37, "DS", "0\\1\\0\\0\\0\\-1") + element(0x20, 0x52, "UI", "1.9") +
      test::number(0x28, 2, 1) + element(0x28, 4, "CS", "MONOCHROME2") +
      test::number(0x28, 0x10, 3) + test::number(0x28, 0x11, 5) +
      element(0x28, 0x30, "DS", "1\\1") + test::number(0x28, 0x100, 16) +
      test::number(0x28, 0x101, 16) + test::number(0x28, 0x102, 15) + test::number(0x28, 0x103, 0) +
      element(0x7FE0, 0x10, "OW", std::string(std::size_t{3} * 5 * 2, '\1')));
}

// The places of the label's samples, in LPS.
std::set<std::array<double, 3>> places_of(std::uint8_t label, const Volume& volume,
                                          const std::string& canonical) {
  std::set<std::array<double, 3>> places;
  const auto& [nx, ny, nz] = volume.dims;
  for (std::size_t n = 0; n < std::size_t{nx} * ny * nz; ++n) {
    if (static_cast<std::uint8_t>(canonical[volume::kHeaderBytes + n]) != label) continue;
    const std::array<std::size_t, 3> index = {n % nx, n / nx % ny, n / nx / ny};
    std::array<double, 3> place = volume.geometry.origin;
    for (std::size_t at = 0; at < 9; ++at) {
      place[at / 3] += volume.geometry.direction[at] * volume.geometry.spacing[at % 3] *
                       static_cast<double>(index[at % 3]);
    }
    places.insert(place);
  }
  return places;
}

// The images to which the frames of a segmentation refer, in their order.
std::vector<std::string> sources_of(const std::string& object) {
  const std::string sequence("\x08\x00\x12\x21SQ", 6);  // SourceImageSequence
  std::vector<std::string> sources;
  for (std::size_t at = object.find(sequence); at != std::string::npos;
       at = object.find(sequence, at + 1)) {
    sources.push_back(object.substr(object.find(kSeries, at), instance_of(0).size()));
  }
  return sources;
}

// The slices of these images follow one another to the right, those of the stored volume to the
// left.
TEST_F(LabelVolumeOrders, OfSagittalImagesLieOnThem) {
  std::vector<std::string> files;
  for (int slice = 0; slice < kSlices; ++slice) files.push_back(sagittal_file(slice));
  main_->hold(files);
  std::string samples(std::size_t{4} * 5 * 3, '\0');  // x, y and z
  for (const std::size_t place : {21, 22, 26, 41, 42, 46}) samples[place] = '\7';
  const Volume labels = add_raw(
      samples, {.dims = {4, 5, 3}, .type = SampleType::kUint8, .geometry = {.origin = {0, 0, 8}}});
  OrderRequest with_labels = request();
  with_labels.label_volume = labels.id;
  const std::string id = submit(with_labels);
  std::optional<store::Lease> lease;
  ASSERT_TRUE(until([&] { return (lease = jobs_.claim("test", minutes(1))).has_value(); }))
      << (get(id).error ? get(id).error->detail : "");
  store::Outcome outcome;
  outcome.mesh.emplace().triangles = 12;
  outcome.mesh->labels = {{.label = 7, .voxels = 6}};
  ASSERT_TRUE(jobs_.finish(*lease, outcome));
  orders_->job_ended(lease->id);
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));

  const std::string object = main_->last_object();
  EXPECT_THAT(sources_of(object), ElementsAre(instance_of(2), instance_of(1)));
  test::write_file(folder_ / "seg", object);
  const Volume again = library_.add("", folder_ / "seg", {}).first;
  EXPECT_EQ(places_of(1, again, blob(again.samples)), places_of(7, labels, blob(labels.samples)));
}

TEST_F(LabelVolumeOrders, NeedLabelsOfTheOwner) {
  EXPECT_EQ(refused(request()), "label_volume");
  volumes_.add("", label_volume());
  OrderRequest other = request();
  other.parameters = R"({"iso": 100})";
  EXPECT_EQ(refused(other), "parameters.labels");
  other = request();
  other.label_volume.reset();
  EXPECT_EQ(refused(other), "label_volume");
  submit(request());
}

TEST_F(LabelVolumeOrders, FailAtOnceIfTheyDoNotFit) {
  volumes_.add("", label_volume());
  const std::string id = submit(request());
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  EXPECT_THAT(get(id).error->detail, HasSubstr("slices"));
}

}  // namespace
}  // namespace isomesh::orders
