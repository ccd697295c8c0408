#include "server/import/source/units.h"

#include <algorithm>
#include <vector>

#include "base/text.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace {

bool counts_samples(std::string_view unit) {
  static constexpr std::string_view kNames[] = {"pixel", "pixels", "voxel", "voxels", "px"};
  return std::ranges::find(kNames, lower(trimmed(unit))) != std::end(kNames);
}

double millimetres_per(std::string_view unit) {
  struct Row {
    double millimetres;
    std::vector<std::string_view> names;
  };
  static const std::vector<Row> units = {
      {1, {"", "?", "???", "mm", "millimeter", "millimeters", "millimetre", "millimetres"}},
      {0.0000001, {"angstrom", "angstroms", "\xc3\x85", "\xe2\x84\xab"}},
      {0.000001, {"nm", "nanometer", "nanometers", "nanometre", "nanometres"}},
      {0.001,
       {"um", "\xc2\xb5m", "\xce\xbcm", "\xb5m", "micron", "microns", "micrometer", "micrometers",
        "micrometre", "micrometres"}},
      {10, {"cm", "centimeter", "centimeters", "centimetre", "centimetres"}},
      {25.4, {"in", "inch", "inches"}},
      {1000, {"m", "meter", "meters", "metre", "metres"}}};
  const std::string name = lower(trimmed(unit));
  for (const Row& row : units) {
    if (std::find(row.names.begin(), row.names.end(), name) != row.names.end()) {
      return row.millimetres;
    }
  }
  throw_unusable("The header's unit of length " + in_quotes(unit) + " is unknown.");
}

}  // namespace

void scale_to_millimetres(Geometry& geometry, std::string_view unit, std::vector<Note>& notes) {
  if (counts_samples(unit)) {
    notes.push_back(note_of(NoteCode::kUnitUnknown,
                            "The file's unit, " + in_quotes(unit) +
                                ", is not a length. One unit was read as one millimetre."));
    return;
  }
  const double millimetres = millimetres_per(unit);
  if (millimetres == 1) return;
  for (double& value : geometry.origin) value *= millimetres;
  for (double& value : geometry.spacing) value *= millimetres;
}

}  // namespace isomesh::import
