// The eight types of sample as types of C++. What depends on the type of a volume's samples is
// written once, as a template, and called through with_sample.
#pragma once

#include <cstdint>
#include <type_traits>

#include "proto/types.h"

// Writes X(type of C++, name, enumerator of SampleType) once for each of the eight: for what no
// template can do, which is to instantiate templates and to fill tables of functions.
#define ISOMESH_FOR_EACH_SAMPLE_TYPE(X) \
  X(std::uint8_t, uint8, kUint8)        \
  X(std::int8_t, int8, kInt8)           \
  X(std::uint16_t, uint16, kUint16)     \
  X(std::int16_t, int16, kInt16)        \
  X(std::uint32_t, uint32, kUint32)     \
  X(std::int32_t, int32, kInt32)        \
  X(float, float32, kFloat32)           \
  X(double, float64, kFloat64)

namespace isomesh {

// Calls `use` with a value-initialised sample of the type, for its static type, and returns what
// that returns, which must be of one type for all eight.
template <class Use>
decltype(auto) with_sample(SampleType type, Use&& use) {
  switch (type) {
#define ISOMESH_USE(Sample, name, kType) \
  case SampleType::kType:                \
    return use(Sample{});
    ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_USE)
#undef ISOMESH_USE
  }
  __builtin_unreachable();  // an enumeration of ours has no other values
}

// The type that a sample of C++ has.
template <class Sample>
constexpr SampleType sample_type() {
#define ISOMESH_IS(Other, name, kType) \
  if constexpr (std::is_same_v<Sample, Other>) return SampleType::kType;
  ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_IS)
#undef ISOMESH_IS
}

}  // namespace isomesh
