#pragma once

#include "proto/presets.h"
#include "proto/types.h"

namespace isomesh::import {

// Adds the presets of a volume in Hounsfield units, of those values that occur in it.
inline void add_ct_presets(Volume& volume) {
  for (const PresetRow& row : kPresets) {
    if (!row.hounsfield) continue;
    // At the smallest sample everything would be inside.
    if (*row.hounsfield <= volume.range[0] || *row.hounsfield > volume.range[1]) continue;
    volume.presets.push_back({std::string(row.name), *row.hounsfield});
  }
}

}  // namespace isomesh::import
