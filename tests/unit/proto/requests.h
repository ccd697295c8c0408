// A request for both its forms.
#pragma once

#include <string>

#include "proto/types.h"

namespace isomesh::test {

// No member as it is by default.
inline JobParameters unusual_parameters(const std::string& volume) {
  return {{.iso = -150,
           .scheme = Scheme::kFive,
           .interpolation = Interpolation::kMidpoint,
           .passes = 17,
           .smoothing = Smoothing::kTaubin,
           .lambda = 0.25,
           .pass_band = 0.05,
           .max_displacement_mm = 0.5,
           .close = true,
           .components = {.keep = 2, .min_triangles = 100, .nearest_to = {}},
           .formats = {MeshFormat::kStl, MeshFormat::kGlb},
           .draco = {.position_bits = 11, .speed = 3},
           .normals = true},
          volume,
          Priority::kBulk};
}

}  // namespace isomesh::test
