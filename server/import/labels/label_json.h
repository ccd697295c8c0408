#pragma once

#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// The labels of a JSON document. It has one of these forms, also as its member "labels":
//   {"1": "spleen", "2": "kidney_right"}                              TotalSegmentator's class map
//   [{"labelValue": 1, "name": "spleen", "color": [0.9, 0.6, 0.5]}]   3D Slicer's segments
// or this one, as that member only:
//   {"labels": {"background": 0, "spleen": 1}}                        nnU-Net's dataset.json
// Returns none for any other document, and for more than Volume::kMostLabels. Unordered. Never
// throws because of the text.
std::vector<LabelEntry> labels_of_json(std::string_view text);

}  // namespace isomesh::import
