// Segmentations with several layers in one file.
#pragma once

#include <filesystem>

#include "server/import/samples/transfer.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Writes the canonical file of all layers as one label map, whose samples are numbers of
// combinations of segments (combinations.h). Returns the volume as finish() does, with its labels.
// `samples` are those of all layers. Values without a segment become labels without a name. Throws
// Error kUnusableVolume also if there are too many combinations.
Volume write_layers(const PlainSamples& samples, const SourceVolume& source, Volume volume,
                    const std::filesystem::path& target);

}  // namespace isomesh::import
