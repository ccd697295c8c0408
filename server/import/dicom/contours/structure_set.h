// RT structure sets (PS3.3, A.19): structures as closed contours in parallel planes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/elements/dataset.h"
#include "server/import/source/names.h"

namespace isomesh::import::dicom {

struct Structure {
  std::uint32_t number = 0;          // as in the file; not always a valid label
  std::string name;                  // UTF-8
  std::optional<std::string> color;  // "#rrggbb"
  // Points in the patient's space, in mm; finite, at least three of each.
  std::vector<std::vector<Vector3>> contours;
};

struct StructureSet {
  std::string frame_of_reference_uid;
  std::vector<Structure> structures;  // those with contours, by number
  std::size_t skipped = 0;            // contours that are open, points, or have too few points
  std::size_t empty = 0;              // structures without closed contours
};

bool is_structure_set(const DataSet& data);

// The frame of reference that a structure set refers to; empty if it names none.
std::string frame_of_structures(const DataSet& data);

// Throws Error kUnusableVolume, naming contour and structure, for coordinates that are not triples
// of finite numbers; if no structure has a closed contour; or if there are more than 65535.
StructureSet read_structures(const DataSet& data);

}  // namespace isomesh::import::dicom
