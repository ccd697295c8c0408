#include "tests/bench/accuracy.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/bench/peers.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {
namespace {

constexpr std::uint32_t kSize = 24;

AccuracyPlan small_plan() { return {.iso = kFieldIso, .threads = 2, .errors_mm = {0.05, 0.2}}; }

TEST(Accuracy, OfOursIsWithinTheErrorAndOthersHaveAboutAsManyTriangles) {
  const std::vector<Approximation> rows =
      measure_approximations(synthetic_field(kSize), small_plan());
  const std::size_t peers = 1 + decimation_peers().size();
  ASSERT_EQ(rows.size(), 2 + 2 * (1 + peers));
  EXPECT_GT(rows[0].bytes, 0U);
  for (std::size_t n = 0; n < 2; ++n) {
    const Approximation& ours = rows[2 + n * (1 + peers)];
    EXPECT_LE(std::max(ours.to_scan.max_mm, ours.from_scan.max_mm), small_plan().errors_mm[n])
        << ours.name;
    EXPECT_LT(ours.triangles, rows[0].triangles);
    EXPECT_LT(ours.bytes, rows[0].bytes);
    for (std::size_t p = 1; p <= peers; ++p) {
      const Approximation& peer = rows[2 + n * (1 + peers) + p];
      EXPECT_GT(peer.triangles, ours.triangles / 2) << peer.name;
      EXPECT_LT(peer.triangles, rows[0].triangles) << peer.name;
      EXPECT_GT(peer.from_scan.max_mm, 0) << peer.name;
    }
  }
  const std::string table = to_text(to_json(rows));
  EXPECT_NE(table.find("E = 0.05 mm"), std::string::npos);
  EXPECT_NE(table.find("meshoptimizer alone"), std::string::npos);
}

TEST(Accuracy, OfSmoothingIsMeasuredBothWays) {
  const CertifyTime time = measure_certify(synthetic_field(kSize), small_plan());
  EXPECT_GT(time.points, 2000U);
  EXPECT_GT(time.certificate.from_mesh.max_mm, 0);
  EXPECT_GT(time.certificate.from_reference.max_mm, 0);
  EXPECT_EQ(to_json(time).at("threads"), 2);
}

TEST(Accuracy, OfLabelsIsTimedAtSomeSpacings) {
  const std::vector<UnevenTime> times = measure_uneven(2);
  ASSERT_EQ(times.size(), 3U);
  for (const UnevenTime& time : times) {
    EXPECT_EQ(time.triangles, times.front().triangles);
    EXPECT_GT(time.certify_ms, 0);
    EXPECT_GT(time.expected_ms, 0);
  }
  EXPECT_EQ(times.back().spacing_z, 1000);
  EXPECT_EQ(to_json(times).size(), 3U);
}

}  // namespace
}  // namespace isomesh::bench
