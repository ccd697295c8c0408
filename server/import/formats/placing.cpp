#include "server/import/formats/placing.h"

#include <cstdint>

namespace isomesh::import {

Geometry geometry_of_ras(const Vector3& origin, const std::array<Vector3, 3>& steps) {
  const auto lps = [](const Vector3& ras) { return Vector3{-ras[0], -ras[1], ras[2]}; };
  return geometry_of(lps(origin), {lps(steps[0]), lps(steps[1]), lps(steps[2])});
}

void check_is_lattice(const std::array<std::uint32_t, 3>& dims) {
  constexpr std::uint64_t kLeast = 1000;  // shorter rows are no surface
  const std::uint64_t samples = std::uint64_t{dims[0]} * dims[1] * dims[2];
  if (dims[1] != 1 || samples < kLeast) return;
  // An icosahedron whose triangles were divided into four again and again.
  bool is_icosahedron = false;
  for (std::uint64_t vertices = 12; vertices <= samples; vertices = (vertices - 2) * 4 + 2) {
    is_icosahedron = is_icosahedron || vertices == samples;
  }
  if (dims[2] != 1 && !is_icosahedron) return;
  throw_unusable(
      "The file holds " + std::to_string(samples) +
      " values in rows of one sample, as FreeSurfer's overlays do: a value for each vertex "
      "of a surface, not a volume.");
}

Note lps_assumed(const std::string& format) {
  return note_of(NoteCode::kSpaceAssumed,
                 format + " has no patient. Its axes x, y and z were read as those of LPS.");
}

Note angstrom_note(const std::string& format) {
  return note_of(NoteCode::kUnitAngstrom,
                 "The coordinates of " + format +
                     " are in angstrom and stay so: read angstrom wherever a length, an area or a "
                     "volume is given in millimetres.");
}

}  // namespace isomesh::import
