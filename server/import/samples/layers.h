// Segmentations whose segments lie in several layers of one file.
#pragma once

#include <filesystem>

#include "server/import/samples/transfer.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Writes the canonical file of all layers as one label map, whose samples number the combinations
// of segments that they are of (combinations.h), and returns the volume as finish() does, with its
// labels. `samples` are those of all layers. Values that no segment has become labels without a
// name. Throws Error kUnusableVolume also when there are too many combinations.
Volume write_layers(const PlainSamples& samples, const SourceVolume& source, Volume volume,
                    const std::filesystem::path& target);

}  // namespace isomesh::import
