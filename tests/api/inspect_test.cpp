// Tests of what a user can see of a volume before starting a job.
#include <numeric>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/png.h"

namespace isomesh {
namespace {

using namespace test;

class InspectTest : public testing::Test {
 protected:
  Answer slice(const std::string& query = {}) const {
    return daemon_.get(path_ + "/slice.png" + (query.empty() ? "" : '?' + query));
  }

  GreyPicture picture(const std::string& query = {}) const {
    const Answer answer = slice(query);
    EXPECT_EQ(answer.status, 200) << answer.body;
    EXPECT_EQ(answer.header("content-type"), "image/png");
    return read_png(answer.body);
  }

  Histogram histogram(const std::string& query = {}) const {
    const Answer answer = daemon_.get(path_ + "/histogram" + query);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return histogram_from_json(answer.body);
  }

  Daemon daemon_;
  const RawUpload sphere_ = sphere_upload();
  const Volume volume_ = upload(daemon_, sphere_);
  const std::string path_ = "/v1/volumes/" + volume_.id;
};

TEST_F(InspectTest, AHistogramCountsEverySample) {
  const Histogram usual = histogram();
  EXPECT_EQ(usual.counts.size(), 256U);
  EXPECT_EQ(usual.range, volume_.range);
  for (const std::string bins : {"1", "2", "100", "65536"}) {
    const Histogram some = histogram("?bins=" + bins);
    EXPECT_EQ(std::to_string(some.counts.size()), bins);
    EXPECT_EQ(std::accumulate(some.counts.begin(), some.counts.end(), std::uint64_t{0}),
              volume_.sample_count());
  }
}

TEST_F(InspectTest, LabelsAreCountedAndKeptByTheClient) {
  std::string samples(24, '\0');
  samples[1] = samples[2] = 3;
  samples[20] = 5;
  const Volume volume = volume_from_json(
      daemon_.send("POST", "/v1/volumes?dims=4,3,2&type=uint8&spacing=1,2,3", samples).body);
  const std::string path = "/v1/volumes/" + volume.id + "/labels";
  const Answer answer = daemon_.get(path);
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "application/json");
  EXPECT_EQ(answer.header("content-length"), std::to_string(answer.body.size()));
  const VolumeLabels list = volume_labels_from_json(answer.body);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[0].voxels, 2U);
  EXPECT_EQ(list.labels[0].volume_mm3, 12);
  EXPECT_EQ(daemon_.client().labels(volume.id), list);
  EXPECT_EQ(daemon_.client().labels(volume.id, 3).labels.size(), 2U);
  const std::string etag = answer.header("etag");
  EXPECT_EQ(daemon_.get(path, {{"If-None-Match", etag}}).status, 304);
  EXPECT_NE(daemon_.get(path + "?background=3").header("etag"), etag);
}

// Each segment has two of the eight samples; one sample belongs to both.
TEST_F(InspectTest, LabelsHaveTheNamesOfTheUpload) {
  const std::string file =
      "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 2 2 2\nkinds: list domain domain domain\n"
      "encoding: raw\nspace: LPS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\n"
      "Segment0_Name:=liver\nSegment0_Layer:=0\nSegment0_Color:=1 0.5 0\n"
      "Segment1_Name:=tumour\nSegment1_Layer:=1\n\n" +
      std::string("\1\0\1\1\0\1\0\0\0\0\0\0\0\0\0\0", 16);
  const Answer uploaded = daemon_.send("POST", "/v1/volumes", file);
  ASSERT_EQ(uploaded.status, 201) << uploaded.body;
  EXPECT_THAT(uploaded.body, testing::Not(testing::HasSubstr("tumour")));
  const std::string id = volume_from_json(uploaded.body).id;
  EXPECT_THAT(daemon_.get("/v1/volumes/" + id).body, testing::Not(testing::HasSubstr("tumour")));
  EXPECT_THAT(daemon_.get("/v1/volumes").body, testing::Not(testing::HasSubstr("tumour")));
  const VolumeLabels list = daemon_.client().labels(id);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[0].name, "liver");
  EXPECT_EQ(list.labels[0].color, "#ff8000");
  EXPECT_EQ(list.labels[0].voxels, 2U);
  EXPECT_EQ(list.labels[1].name, "tumour");
  EXPECT_EQ(list.labels[1].voxels, 2U);
}

TEST_F(InspectTest, FractionsHaveNoLabels) {
  // Samples of 0.5.
  std::string samples;
  for (int at = 0; at < 8; ++at) samples += std::string("\0\0\0\x3f", 4);
  const Volume fractions =
      volume_from_json(daemon_.send("POST", "/v1/volumes?dims=2,2,2&type=float32", samples).body);
  const Answer answer = daemon_.get("/v1/volumes/" + fractions.id + "/labels");
  EXPECT_TRUE(is_problem(answer, ErrorCode::kUnusableVolume));
  EXPECT_THAT(answer.body, testing::HasSubstr("one of the samples is 0.5"));
}

TEST_F(InspectTest, ASliceIsTheSamplesOfTheUpload) {
  const GreyPicture z = picture("axis=z&index=3&window=0,255");
  EXPECT_EQ(z.width, 21U);
  EXPECT_EQ(z.height, 20U);
  for (std::size_t at = 0; at < z.pixels.size(); ++at) {
    ASSERT_EQ(z.pixels[at], static_cast<unsigned char>(sphere_.bytes[3 * 21 * 20 + at])) << at;
  }
  EXPECT_EQ(picture("axis=x&index=20").height, 19U);
  EXPECT_EQ(picture("axis=y").width, 21U);
}

TEST_F(InspectTest, TheMiddleInTheVolumesRangeIsTheDefault) {
  const GreyPicture usual = picture();
  const std::string range =
      std::to_string(volume_.range[0]) + ',' + std::to_string(volume_.range[1]);
  EXPECT_EQ(usual.pixels, picture("axis=z&index=9&window=" + range).pixels);
  EXPECT_THAT(usual.pixels, testing::Contains(255));
}

TEST_F(InspectTest, APreviewIsTheVolumeReduced) {
  const Answer answer = daemon_.get(path_ + "/preview?size=10&window=0,255");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-length"), std::to_string(answer.body.size()));
  EXPECT_THAT(answer.body, testing::StartsWith("NRRD0004\n"));
  EXPECT_THAT(answer.body, testing::HasSubstr("\nsizes: 7 10 10\n"));
  // It is a volume like any other.
  const Answer again = daemon_.send("POST", "/v1/volumes", answer.body);
  ASSERT_EQ(again.status, 201) << again.body;
  EXPECT_THAT(volume_from_json(again.body).dims, testing::ElementsAre(7, 10, 10));
  // No larger than asked for, it is what was uploaded.
  const Answer whole = daemon_.get(path_ + "/preview?window=0,255");
  EXPECT_TRUE(whole.body.ends_with(sphere_.bytes));
}

TEST_F(InspectTest, ASliceHasTheSamplesThatWereUploaded) {
  std::vector<std::int16_t> samples(2 * 3 * 4);
  std::iota(samples.begin(), samples.end(), static_cast<std::int16_t>(-7));
  const Volume volume = upload(
      daemon_, {.bytes = bytes_of(samples), .query = "dims=2,3,4&type=int16", .options = {}});
  const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
    return samples[x + 2 * (y + 3 * z)];
  };
  const auto slice_of = [&](const std::string& query) {
    return daemon_.get("/v1/volumes/" + volume.id + "/slice" + query);
  };
  const Answer z = slice_of("?index=3");
  EXPECT_EQ(z.status, 200);
  EXPECT_EQ(z.header("content-type"), "application/octet-stream");
  EXPECT_EQ(z.header("isomesh-sample-type"), "int16");
  EXPECT_EQ(z.header("isomesh-slice"), "2,3");
  EXPECT_EQ(z.body, bytes_of(std::vector{at(0, 0, 3), at(1, 0, 3), at(0, 1, 3), at(1, 1, 3),
                                         at(0, 2, 3), at(1, 2, 3)}));
  const Answer y = slice_of("?axis=y&index=1");
  EXPECT_EQ(y.header("isomesh-slice"), "2,4");
  EXPECT_EQ(y.body, bytes_of(std::vector{at(0, 1, 0), at(1, 1, 0), at(0, 1, 1), at(1, 1, 1),
                                         at(0, 1, 2), at(1, 1, 2), at(0, 1, 3), at(1, 1, 3)}));
  const Answer x = slice_of("?axis=x");
  EXPECT_EQ(x.header("isomesh-slice"), "3,4");
  EXPECT_EQ(x.body, bytes_of(std::vector{at(1, 0, 0), at(1, 1, 0), at(1, 2, 0), at(1, 0, 1),
                                         at(1, 1, 1), at(1, 2, 1), at(1, 0, 2), at(1, 1, 2),
                                         at(1, 2, 2), at(1, 0, 3), at(1, 1, 3), at(1, 2, 3)}));
  EXPECT_TRUE(blames(slice_of("?index=4"), "index"));
  EXPECT_TRUE(blames(slice_of("?axis=w"), "axis"));
  EXPECT_TRUE(blames(slice_of("?window=0,1"), "window"));
}

TEST_F(InspectTest, WhatNeverChangesIsNotSentTwice) {
  for (const std::string what :
       {"/histogram", "/slice.png?index=2", "/slice?index=2", "/preview?size=5"}) {
    const Answer first = daemon_.get(path_ + what);
    EXPECT_THAT(first.header("cache-control"), testing::HasSubstr("immutable"));
    const std::string etag = first.header("etag");
    ASSERT_FALSE(etag.empty());
    const Answer again = daemon_.get(path_ + what, {{"If-None-Match", etag}});
    EXPECT_EQ(again.status, 304);
    EXPECT_TRUE(again.body.empty());
    EXPECT_EQ(again.header("etag"), etag);
  }
  EXPECT_NE(slice("window=0,10").header("etag"), slice("window=0,11").header("etag"));
  EXPECT_NE(slice("axis=x&index=1").header("etag"), slice("axis=y&index=1").header("etag"));
}

TEST_F(InspectTest, AnEstimateCountsWhatTheJobMakes) {
  const Answer answer =
      daemon_.get("/v1/estimate?volume=" + volume_.id + "&iso=100&scheme=5&format=drc,stl");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Estimate estimate = estimate_from_json(answer.body);
  const Job job = finished_job(daemon_, R"("scheme": 5, "formats": ["drc", "stl"])");
  EXPECT_EQ(estimate.triangles, job.mesh->triangles);
  EXPECT_EQ(estimate.vertices, job.mesh->vertices);
  EXPECT_EQ(estimate.bytes.at(MeshFormat::kStl), job.mesh->files.at(MeshFormat::kStl).bytes);
  EXPECT_TRUE(estimate.fits);
  EXPECT_EQ(estimate.queue, Estimate::Queue{});
}

}  // namespace
}  // namespace isomesh
