// Label volumes on the grid of a series, and the segmentations made from them.
#include "server/hospital/objects/segmentation.h"

#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "proto/samples.h"
#include "server/hospital/orders/label_grid.h"
#include "server/volume/canonical.h"
#include "tests/support/errors.h"
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

using dicom::SegmentationFrame;
using testing::ElementsAre;
using testing::HasSubstr;

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
  EXPECT_THAT(reason_of(labels), HasSubstr("not at the places"));
  labels = label_volume();
  labels.labels = {{.label = 1, .values = {1, 3}}};
  EXPECT_THAT(reason_of(labels), HasSubstr("share"));
}

class SegmentationTest : public OrdersTest {
 protected:
  template <class Sample>
  LabelGrid grid_of(const std::vector<Sample>& samples, const Geometry& geometry) {
    Volume labels = label_volume();
    labels.type = sample_type<Sample>();
    labels.geometry = geometry;
    std::string file(volume::kHeaderBytes, ' ');
    file.resize(file.size() + samples.size() * sizeof(Sample));
    std::memcpy(file.data() + volume::kHeaderBytes, samples.data(),
                samples.size() * sizeof(Sample));
    labels.samples = test::put(blobs_, file).key;
    return label_grid(kImages, kSizes, labels);
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
