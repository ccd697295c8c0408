#include "server/mesh/extract/nearness.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace isomesh::mesh {
namespace {

// The order that ranks stand for.
bool is_nearer(double iso, double a, double b) {
  const auto distance = [&](double value) { return static_cast<float>(std::abs(value - iso)); };
  return std::pair(distance(a), a < iso) < std::pair(distance(b), b < iso);
}

// At and around a value and a middle of two, also as near as single precision does not resolve.
std::vector<double> iso_values_near(double value) {
  std::vector<double> found;
  for (const double at : {value, value + 0.5}) {
    for (const double apart : {0.0, 0.25, 1e-3, 1e-11, 1e-20}) {
      found.push_back(at - apart);
      found.push_back(at + apart);
    }
  }
  return found;
}

template <class T, class Rank>
void expect_order_of_samples(double iso, int step) {
  const Nearness<T> nearness(iso, false);
  const bool is_whole = nearness.bytes() == sizeof(std::int32_t);
  ASSERT_TRUE(is_whole || nearness.bytes() == sizeof(Rank)) << iso;
  const auto rank = [&](int value) -> std::int32_t {
    if (is_whole) return nearness.of_value(value);
    return nearness.template of_sample<Rank>(static_cast<T>(value));
  };
  constexpr int kHighest = std::numeric_limits<T>::max();
  for (int a = std::numeric_limits<T>::lowest(); a <= kHighest; a += step) {
    if (a < iso) continue;
    for (int b = std::numeric_limits<T>::lowest(); b < iso && b <= kHighest; ++b) {
      ASSERT_EQ(rank(a) < rank(b), is_nearer(iso, a, b)) << iso << ": " << a << ", " << b;
      ASSERT_EQ(rank(b) < rank(a), is_nearer(iso, b, a)) << iso << ": " << a << ", " << b;
    }
  }
}

TEST(Nearness, OrdersBytesAsTheirDistances) {
  for (const double value : {0.0, 1.0, 77.0, 254.0, 255.0}) {
    for (const double iso : iso_values_near(value)) {
      expect_order_of_samples<std::uint8_t, std::int8_t>(iso, 1);
      expect_order_of_samples<std::int8_t, std::int8_t>(iso - 128, 1);
    }
  }
}

TEST(Nearness, OrdersSixteenBitsAsTheirDistances) {
  constexpr int kSome = 4099;
  for (const double iso : iso_values_near(30000)) {
    expect_order_of_samples<std::uint16_t, std::int16_t>(iso, kSome);
    expect_order_of_samples<std::int16_t, std::int16_t>(iso - 32768, kSome);
  }
}

TEST(Nearness, OrdersMeansOfEightBytesWithThem) {
  for (const double iso : iso_values_near(100)) {
    const Nearness<std::uint8_t> nearness(iso, true);
    if (nearness.bytes() == sizeof(std::int32_t)) continue;  // of values, as above
    ASSERT_EQ(nearness.bytes(), sizeof(std::int16_t));
    const auto of_sum = [&](int sum) { return nearness.of_sum<std::int16_t>(sum); };
    for (int a = 0; a <= 8 * 255; a += 3) {
      EXPECT_EQ(of_sum(a / 8 * 8),
                nearness.of_sample<std::int16_t>(static_cast<std::uint8_t>(a / 8)));
      for (int b = 0; b <= 8 * 255; b += 7) {
        if ((a / 8.0 < iso) == (b / 8.0 < iso)) continue;
        ASSERT_EQ(of_sum(a) < of_sum(b), is_nearer(iso, a / 8.0, b / 8.0))
            << iso << ": " << a << ", " << b;
      }
    }
  }
}

TEST(Nearness, TakesStepsOfOneByteWhereValuesAreBytes) {
  EXPECT_EQ(Nearness<std::uint8_t>(60, false).bytes(), 1);
  EXPECT_EQ(Nearness<std::uint8_t>(60, true).bytes(), 2);
  EXPECT_EQ(Nearness<std::int16_t>(-300, false).bytes(), 2);
  EXPECT_EQ(Nearness<std::int16_t>(-300, true).bytes(), 4);
  EXPECT_EQ(Nearness<float>(0.5, false).bytes(), 4);
  // The one sample is nearer by less than single precision tells.
  EXPECT_EQ(Nearness<std::uint8_t>(60 + 1e-11, false).bytes(), 4);
}

TEST(Nearness, OrdersNumbersThatSinglePrecisionDoesNotHold) {
  for (const double scale :
       {0x1p-1040, 0x1p-400, 0x1p-130, 0x1p-50, 1.0, 0x1p60, 0x1p200, 0x1p1022}) {
    SCOPED_TRACE(scale);
    const std::vector<double> samples = {-3 * scale, 1.5 * scale, 2 * scale};
    const double power = power_for(samples.data(), samples.size(), 0);
    const Nearness<double> nearness(0, false, power);
    EXPECT_LT(nearness.of_value(samples[1]), nearness.of_value(samples[2]));
    EXPECT_LT(nearness.of_value(samples[2]), nearness.of_value(samples[0]));
    EXPECT_EQ(power == 1, scale >= 0x1p-50 && scale <= 0x1p60);
  }
  const std::vector<double> widest = {-1.7e308, 1.2e308};
  const Nearness<double> nearness(-1e308, false, power_for(widest.data(), 2, -1e308));
  EXPECT_LT(nearness.of_value(widest[0]), nearness.of_value(widest[1]));
  const std::vector<double> filled = {-std::numeric_limits<double>::max(), 1.5, 2, -3, 1e300};
  EXPECT_EQ(power_for(filled.data(), filled.size(), 0), 1);
  const std::vector<double> tiny = {-std::numeric_limits<double>::max(), 0x1p-400, 0x1p-401};
  EXPECT_EQ(power_for(tiny.data(), tiny.size(), 0), 0x1p400);
  const std::vector<double> equal = {7, 7};
  EXPECT_EQ(power_for(equal.data(), equal.size(), 7), 1);
}

}  // namespace
}  // namespace isomesh::mesh
