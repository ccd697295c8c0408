#include "proto/types.h"

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/enumerators.h"

namespace isomesh {
namespace {

using test::names;

template <class Enum>
void expect_names(const std::vector<std::string>& expected) {
  EXPECT_EQ(names<Enum>(), expected);
  for (const std::string& name : expected) {
    const auto value = from_string<Enum>(name);
    ASSERT_TRUE(value) << name;
    EXPECT_EQ(to_string(*value), name);
  }
  for (const std::string wrong : {"", " ", "DRC", "Linear", "uint8 ", "0", "5"}) {
    EXPECT_EQ(from_string<Enum>(wrong), std::nullopt) << wrong;
  }
}

TEST(Names, AreThoseOfTheContract) {
  expect_names<SampleType>(
      {"uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"});
  expect_names<Interpolation>({"linear", "midpoint"});
  expect_names<GlbCodec>({"draco", "none", "meshopt", "khr-meshopt", "quantized"});
  expect_names<Space>({"lps", "ras"});
  expect_names<Priority>({"stat", "routine", "bulk"});
  expect_names<JobState>({"queued", "running", "succeeded", "failed", "cancelled"});
}

TEST(Smoothings, HaveNamesAndSayWhatTheyDo) {
  std::set<Smoothing> found;
  for (const SmoothingRow& row : kSmoothings) {
    EXPECT_EQ(from_string<Smoothing>(row.name), row.smoothing);
    EXPECT_EQ(to_string(row.smoothing), row.name);
    EXPECT_NE(std::string(row.more).find('`' + std::string(row.name) + '`'), std::string::npos);
    EXPECT_FALSE(std::string(row.meaning).empty());
    found.insert(row.smoothing);
  }
  EXPECT_EQ(found.size(), values_of<Smoothing>().size());
}

TEST(NamesOf, AreForPeople) {
  EXPECT_EQ(names_of<Interpolation>(), R"("linear" or "midpoint")");
  EXPECT_EQ(names_of<Priority>(), R"("stat", "routine" or "bulk")");
  EXPECT_EQ(names_of<JobState>(), R"("queued", "running", "succeeded", "failed" or "cancelled")");
}

TEST(BytesPerSample, FollowsTheName) {
  const std::vector<std::size_t> expected = {1, 1, 2, 2, 4, 4, 4, 8};
  for (std::size_t number = 0; number < expected.size(); ++number) {
    EXPECT_EQ(bytes_per_sample(SampleType{static_cast<int>(number)}), expected[number]);
  }
}

TEST(IsFinal, IsTrueForTheThreeEnds) {
  EXPECT_FALSE(is_final(JobState::kQueued));
  EXPECT_FALSE(is_final(JobState::kRunning));
  EXPECT_TRUE(is_final(JobState::kSucceeded));
  EXPECT_TRUE(is_final(JobState::kFailed));
  EXPECT_TRUE(is_final(JobState::kCancelled));
}

TEST(Volume, CountsSamplesBeyond32Bits) {
  Volume volume;
  volume.dims = {4096, 4096, 4096};
  EXPECT_EQ(volume.sample_count(), std::uint64_t{1} << 36);
}

// The contract's table.
TEST(JobParameters, HaveTheContractsDefaults) {
  const JobParameters parameters;
  EXPECT_EQ(parameters.scheme, SchemeName::kSix);
  EXPECT_EQ(parameters.interpolation, Interpolation::kLinear);
  EXPECT_EQ(parameters.passes, 5);
  EXPECT_EQ(parameters.smoothing, Smoothing::kLaplacian);
  EXPECT_EQ(parameters.lambda.value_or(default_lambda(parameters)), 1);
  EXPECT_EQ(parameters.pass_band, 0.1);
  EXPECT_EQ(parameters.max_displacement_mm, std::nullopt);
  EXPECT_FALSE(parameters.close);
  EXPECT_EQ(parameters.formats, std::vector{MeshFormat::kDrc});
  EXPECT_EQ(parameters.draco, (DracoParameters{.position_bits = 14, .speed = 7}));
  EXPECT_EQ(parameters.priority, Priority::kRoutine);
}

}  // namespace
}  // namespace isomesh
