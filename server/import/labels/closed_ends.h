// Segmentations whose labels reach the end of what is told.
#pragma once

#include <array>
#include <cstdint>

#include "proto/types.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// The sizes with room for a plane on each side. Throws Error kTooLarge if samples of `type` would
// exceed the limits then, kUnusableVolume if a size is not plausible.
std::array<std::uint32_t, 3> with_room(const std::array<std::uint32_t, 3>& dims, SampleType type,
                                       const SizeLimits& limits);

// Adds a plane of zeros at each side of a segmentation that a nonzero sample touches: programs
// leave empty planes out, and nothing is beyond the last. So the surfaces of labels are closed
// there. An axis of one sample gets planes at both sides. Sides without labels stay as they are.
//
// `writer` was made for with_room(), and begins with the samples of `volume.dims`. Sets
// dims and origin of `volume`, shortens the file to them, and adds to the note on empty planes.
// Throws Error kUnusableVolume if the grown geometry is not valid, kInternal.
void close_ends(CanonicalWriter& writer, Volume& volume);

}  // namespace isomesh::import
