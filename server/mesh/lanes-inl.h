// Eight lanes of single precision, and points of them. Compiled once for each instruction set by
// the sources that include it through Highway's foreach_target.h, such as fans.cpp.
#if defined(ISOMESH_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_LANES_INL_H_
#undef ISOMESH_LANES_INL_H_
#else
#define ISOMESH_LANES_INL_H_
#endif

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

inline constexpr std::size_t kLanes = 8;
using Lanes = float __attribute__((vector_size(32)));
using Mask = std::int32_t __attribute__((vector_size(32)));  // -1: yes
inline constexpr float kTiny = 1e-37F;                       // added where 0 would be divided by

HWY_INLINE Lanes splat(float value) { return Lanes{} + value; }
HWY_INLINE Mask splat_int(int value) { return Mask{} + value; }
HWY_INLINE Lanes larger(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
HWY_INLINE Lanes smaller(const Lanes& a, const Lanes& b) { return a < b ? a : b; }

HWY_INLINE Lanes root(const Lanes& square) {
  Lanes result;
  for (std::size_t lane = 0; lane < kLanes; ++lane) result[lane] = std::sqrt(square[lane]);
  return result;
}

// A bit for each lane, the lowest of the first one.
HWY_INLINE unsigned bits(const Mask& mask) {
#if HWY_TARGET == HWY_AVX2
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  unsigned all = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) all |= (mask[lane] & 1U) << lane;
  return all;
#endif
}

HWY_INLINE bool any(const Mask& mask) { return bits(mask) != 0; }

HWY_INLINE Lanes load(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}

HWY_INLINE void store(const Lanes& lanes, float* to) { std::memcpy(to, &lanes, sizeof lanes); }

// The largest whole numbers that are not larger; of numbers within 2^31.
HWY_INLINE Mask floor_of(const Lanes& x) {
  const Mask cut = __builtin_convertvector(x, Mask);
  return cut + (__builtin_convertvector(cut, Lanes) > x);
}
HWY_INLINE Lanes as_lanes(const Mask& whole) { return __builtin_convertvector(whole, Lanes); }

// from[index] of each lane.
HWY_INLINE Lanes gather(const float* from, const Mask& index) {
#if HWY_TARGET == HWY_AVX2
  return reinterpret_cast<Lanes>(_mm256_i32gather_ps(from, reinterpret_cast<__m256i>(index), 4));
#else
  Lanes result;
  for (std::size_t lane = 0; lane < kLanes; ++lane) result[lane] = from[index[lane]];
  return result;
#endif
}

struct Lanes3 {
  Lanes x;
  Lanes y;
  Lanes z;
};

HWY_INLINE Lanes3 operator+(const Lanes3& a, const Lanes3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
HWY_INLINE Lanes3 operator-(const Lanes3& a, const Lanes3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
HWY_INLINE Lanes3 operator*(const Lanes& s, const Lanes3& a) { return {s * a.x, s * a.y, s * a.z}; }
HWY_INLINE Lanes3 operator*(float s, const Lanes3& a) { return splat(s) * a; }

HWY_INLINE Lanes dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

HWY_INLINE Lanes3 cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Zero if `a` is zero.
HWY_INLINE Lanes3 unit(const Lanes3& a) { return (1 / root(dot(a, a) + kTiny)) * a; }

HWY_INLINE Lanes3 choose(const Mask& mask, const Lanes3& yes, const Lanes3& no) {
  return {mask ? yes.x : no.x, mask ? yes.y : no.y, mask ? yes.z : no.z};
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
