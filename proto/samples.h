// The eight sample types as C++ types. Code that depends on the sample type is a template called
// through with_sample.
#pragma once

#include <cstdint>
#include <type_traits>

#include "proto/types.h"

// Writes X(C++ type, name, enumerator of SampleType) for each of the eight types: to instantiate
// templates and to fill tables of functions.
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

// Calls `use` with a value-initialised sample of the type and returns its result, which has the
// same type for all eight.
template <class Use>
decltype(auto) with_sample(SampleType type, Use&& use) {
  switch (type) {
#define ISOMESH_USE(Sample, name, kType) \
  case SampleType::kType:                \
    return use(Sample{});
    ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_USE)
#undef ISOMESH_USE
  }
  __builtin_unreachable();  // our own enumeration has no other values
}

template <class Sample>
constexpr SampleType sample_type() {
#define ISOMESH_IS(Other, name, kType) \
  if constexpr (std::is_same_v<Sample, Other>) return SampleType::kType;
  ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_IS)
#undef ISOMESH_IS
}

}  // namespace isomesh
