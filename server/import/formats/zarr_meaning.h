// The meaning of OME-Zarr's metadata: axes, geometry and labels.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "server/import/formats/zarr_array.h"
#include "server/import/source/source.h"

namespace isomesh::import {

struct ZarrAxis {
  std::string name = {};
  std::string type = {};
  std::string unit = {};
  std::string orientation = {};
};

// The group's metadata of OME: 0.5 has it below attributes of a `zarr.json`.
const Json& zarr_ome(const Json& group);

// So many axes of a multiscale. Throws Error kUnusableVolume if it names others.
std::vector<ZarrAxis> zarr_axes(const Json& scales, std::size_t count);

// The array's axes of x, y and z: the fastest of space is x, unless they have these names. Throws
// Error kUnusableVolume unless there are three.
std::array<std::size_t, 3> zarr_spatial_axes(const std::vector<ZarrAxis>& axes);

// By the first dataset of a multiscale. Throws Error kUnusableVolume.
void set_zarr_geometry(const Json& scales, const std::vector<ZarrAxis>& axes,
                       const std::array<std::size_t, 3>& spatial, SourceVolume& source);

// Names and colours of `image-label`; its values are labels even without them. Throws Error
// kUnusableVolume.
void set_zarr_labels(const Json& group, SourceVolume& source);

}  // namespace isomesh::import
