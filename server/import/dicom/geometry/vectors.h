// Vector arithmetic in the patient's space.
#pragma once

#include <cmath>

#include "server/import/source/names.h"

namespace isomesh::import::dicom {

inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline Vector3 difference(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

// `direction` is a unit vector, `distance` in mm.
inline Vector3 moved(const Vector3& place, const Vector3& direction, double distance) {
  return {place[0] + direction[0] * distance, place[1] + direction[1] * distance,
          place[2] + direction[2] * distance};
}

inline double length(const Vector3& v) { return std::hypot(v[0], v[1], v[2]); }

}  // namespace isomesh::import::dicom
