#include "server/codec/draco/normal_coder.h"

#include <cmath>
#include <cstdlib>

#include <draco/compression/attributes/normal_compression_utils.h>
#include <draco/compression/attributes/prediction_schemes/prediction_scheme_normal_octahedron_canonicalized_encoding_transform.h>

#include "server/codec/draco/encoder.h"

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::uint32_t kSymbols = 1U << kNormalBits;
using Transform =
    draco::PredictionSchemeNormalOctahedronCanonicalizedEncodingTransform<std::int32_t>;

// std::floor, which is a library call without SSE4.1.
std::int32_t rounded_down(double x) {
  const auto whole = static_cast<std::int32_t>(x);
  return whole - (x < whole ? 1 : 0);
}

// Projects a normal onto the octahedron with half-diagonal `center`. Bit-identical to libdraco's
// FloatVectorToQuantizedOctahedralCoords.
std::array<std::int32_t, 3> on_octahedron(const mesh::Vec3& normal, std::int32_t center) {
  const double x = normal[0];
  const double y = normal[1];
  const double z = normal[2];
  const double sum = std::abs(x) + std::abs(y) + std::abs(z);
  if (!(sum > 1e-6) || std::isinf(sum)) return {center, 0, 0};  // no direction
  const double scale = 1.0 / sum;
  const std::int32_t a = rounded_down(x * scale * center + 0.5);
  const std::int32_t b = rounded_down(y * scale * center + 0.5);
  // Rounding may have made the first two too long.
  const std::int32_t c = center - std::abs(a) - std::abs(b);
  if (c < 0) return {a, b > 0 ? b + c : b - c, 0};
  return {a, b, z * scale < 0 ? -c : c};
}

}  // namespace

void NormalCoder::quantise(std::span<const mesh::Vec3> normals, std::size_t begin,
                           std::size_t end) {
  draco::OctahedronToolBox octahedron;
  octahedron.SetQuantizationBits(kNormalBits);
  for (std::size_t v = begin; v < end; ++v) {
    std::int32_t s = 0;
    std::int32_t t = 0;
    const auto place = on_octahedron(normals[v], octahedron.center_value());
    octahedron.IntegerVectorToQuantizedOctahedralCoords(place.data(), &s, &t);
    coordinates_[v] = {static_cast<std::uint16_t>(s), static_cast<std::uint16_t>(t)};
  }
}

CodedValues NormalCoder::code(const Connectivity& surface, const ValueOrder& order) {
  symbols_.resize_for_overwrite(order.count());
  std::vector<std::uint64_t> counts(kSymbols);
  const Transform transform(static_cast<std::int32_t>(kSymbols) - 1);
  std::array<std::int32_t, 2> before = {0, 0};
  // The decoder visits components from last to first.
  for (auto component = order.components().rbegin(); component != order.components().rend();
       ++component) {
    for (std::uint32_t i = component->begin; i < component->end; ++i) {
      const Coordinates& own = coordinates_[surface.vertex(order.corners()[i] & ~kFirstValue)];
      const std::array<std::int32_t, 2> value = {own[0], own[1]};
      std::array<std::int32_t, 2> correction;
      transform.ComputeCorrection(value.data(), before.data(), correction.data());
      before = value;
      symbols_[i] = {static_cast<std::uint16_t>(correction[0]),
                     static_cast<std::uint16_t>(correction[1])};
      ++counts[symbols_[i][0]];
      ++counts[symbols_[i][1]];
    }
  }
  return code_raw(best_coding(counts), symbols_.data()->data(), 2, order, coded_);
}

}  // namespace isomesh::codec::edgebreaker
