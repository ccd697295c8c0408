// Structured reports of measurements: their contents, and the orders that send them.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/hospital/objects/measurement_report.h"
#include "server/hospital/orders/make_objects.h"
#include "server/hospital/orders/measure_surfaces.h"
#include "tests/unit/hospital/fixture.h"

namespace isomesh::dicom {
namespace {

using testing::HasSubstr;
using testing::Not;

class ReportTest : public testing::Test {
 protected:
  std::string made() {
    return make_report({.common = {.identity = identity_,
                                   .sop_instance_uid = "2.25.2",
                                   .series_uid = "2.25.1",
                                   .series_number = 9001,
                                   .title = "Bone",
                                   .made = {},
                                   .station_name = "here"},
                        .segmented_series_uid = segmented_series_,
                        .algorithm_parameters = "{}",
                        .deviation = deviation_,
                        .surfaces = {surface_}});
  }

  DicomIdentity identity_ = [] {
    DicomIdentity identity;
    identity.modality = "CT";
    identity.study_uid = "1.2";
    identity.series_uid = "1.3";
    identity.instances = {{"1.2.840.10008.5.1.4.1.1.2", "1.5.1"}};
    return identity;
  }();
  std::string segmented_series_;
  std::optional<Deviation> deviation_;
  MeasuredSurface surface_ = {
      .name = "Bone", .volume_mm3 = 1234.5678901, .area_mm2 = 0.1, .diameter_mm = 98.25};
};

TEST_F(ReportTest, TellsEachMeasurementWithItsUnit) {
  const std::string report = made();
  for (const char* text : {"1234.56789", "RNU0", "mm3", "C0JK", "mm2", "L0JK", "98.25"}) {
    EXPECT_THAT(report, HasSubstr(text));
  }
  EXPECT_EQ(report.size() % 2, 0U);
}

TEST_F(ReportTest, OfAnOpenSurfaceTellsThatItHasNoVolume) {
  EXPECT_THAT(made(), Not(HasSubstr("114006")));
  surface_.volume_mm3.reset();
  EXPECT_THAT(made(), HasSubstr("114006"));
}

TEST_F(ReportTest, TellsTheUncertaintyOnlyIfThereIsABound) {
  EXPECT_THAT(made(), Not(HasSubstr("99ISOMESH")));
  deviation_ = Deviation{.mm = 0.375};
  EXPECT_THAT(made(), HasSubstr("deviation-found"));
  EXPECT_THAT(made(), HasSubstr("0.375"));
  EXPECT_THAT(made(), Not(HasSubstr("371884006")));
  deviation_->is_bound = true;
  EXPECT_THAT(made(), HasSubstr("deviation-bound"));
  EXPECT_THAT(made(), HasSubstr("371884006"));
  EXPECT_THAT(made(), HasSubstr("0.75"));  // a diameter has two ends
}

TEST_F(ReportTest, OfASegmentationRefersToItsSegments) {
  identity_.instances = {{"1.2.840.10008.5.1.4.1.1.66.4", "1.5.1"}};
  surface_.segment = DicomSegment{.label = 258,
                                  .category = {"49755003", "SCT", "Morphologically abnormal"},
                                  .type = {"52988006", "SCT", "Lesion"},
                                  .region = {"12738006", "SCT", "Brain"}};
  EXPECT_THAT(made(), Not(HasSubstr("121191")));  // the template needs the source series
  EXPECT_THAT(made(), HasSubstr("111028"));
  segmented_series_ = "1.7.7";
  const std::string report = made();
  EXPECT_THAT(report, HasSubstr("121191"));
  EXPECT_THAT(report, HasSubstr(std::string("\x62\0\x0B\0US\2\0\2\1", 10)));
  EXPECT_THAT(report, HasSubstr("1.7.7"));
  EXPECT_THAT(report, HasSubstr("52988006"));
  EXPECT_THAT(report, HasSubstr("12738006"));
  EXPECT_THAT(report, Not(HasSubstr("111028")));
}

}  // namespace
}  // namespace isomesh::dicom

namespace isomesh::orders {
namespace {

class ReportingOrdersTest : public OrdersTest {
 protected:
  std::string submit_report() {
    OrderRequest request;
    request.source = {.pacs = "main", .study = kStudy, .series = kSeries};
    request.parameters = R"({"iso": 100, "formats": ["glb"]})";
    request.send = {{.pacs = "main", .format = SendFormat::kSr}};
    return submit(request);
  }
};

TEST(DescriptionOfAJob, TellsWhichSideOfTheIsoValueIsInside) {
  Job job;
  job.mesh.emplace();
  job.parameters.iso = 300;
  job.parameters.passes = 5;
  EXPECT_EQ(description_of(job), "iso 300, scheme 6, 5 passes");
  job.parameters.inside = Inside::kBelow;
  EXPECT_EQ(description_of(job), "below 300, scheme 6, 5 passes");
  job.parameters.iso.reset();
  EXPECT_EQ(description_of(job), "below otsu, scheme 6, 5 passes");
  job.parameters.iso = -1234.56789012345;
  job.mesh->certificate.emplace().bound_mm = 123.4567;
  EXPECT_THAT(description_of(job), testing::StartsWith("below -1234.56789012345, scheme 6, "));
  EXPECT_LE(description_of(job).size(), 64U);
}

TEST(TextOfMeasurements, TellsAnOpenSurfaceFromOneThatIsInsideOut) {
  dicom::MeasuredSurface surface = {.name = "Bone", .area_mm2 = 2, .diameter_mm = 3};
  EXPECT_EQ(text_of({surface}), " Bone open 2 3\n");
  surface.is_inside_out = true;
  EXPECT_EQ(text_of({surface}), " Bone inside out 2 3\n");
}

TEST_F(ReportingOrdersTest, SendOneReportAndAskForItsBound) {
  const std::string id = submit_report();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded)) << get(id).error->detail;
  EXPECT_TRUE(last_parameters_.certify);
  EXPECT_THAT(last_parameters_.formats, ElementsAre(MeshFormat::kGlb, MeshFormat::kStl));
  const std::vector<OrderResult> results = get(id).results;
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results.front().format, SendFormat::kSr);
  EXPECT_EQ(results.front().sop_class_uid, dicom::kEnhancedSrStorage);
  EXPECT_EQ(main_->stores, 1);
}

TEST_F(ReportingOrdersTest, ThatAreRepeatedHaveTheSameReport) {
  const std::string first = submit_report();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(first, OrderState::kSucceeded));
  const std::string second = submit_report();  // its job finds the mesh of the first one
  ASSERT_TRUE(reaches(second, OrderState::kSucceeded));
  EXPECT_EQ(get(first).results, get(second).results);
  EXPECT_EQ(main_->stores, 1);
}

// AlgorithmParameters can have 10 240 characters.
TEST_F(OrdersTest, WithLongParametersHaveAnObjectThatTellsTheirBeginning) {
  std::string places;
  for (int n = 0; n < 900; ++n) places += (n > 0 ? "," : "") + std::string("[0.123456789,1,2]");
  const std::string id =
      submit("main", kSeries, R"({"iso": 100, "components": {"nearest_to": [)" + places + "]}}");
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded)) << get(id).error->detail;
  const std::string object = main_->last_object();
  const std::size_t parameters = object.find(std::string("\x66\0\x32\0LT", 6));
  ASSERT_NE(parameters, object.npos);
  EXPECT_EQ(object.substr(parameters + 6, 3), std::string("\0\x28{", 3));  // 10 240, and the text
  EXPECT_EQ(object.substr(parameters + 8 + 10'240 - 3, 3), "...");
}

}  // namespace
}  // namespace isomesh::orders
