// The frames of a series -> its volumes: times, echoes, b-values and others.
#pragma once

#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

struct SeriesVolume {
  std::string title;  // distinguishes it: "EchoTime 4.92, 20 slices"
  std::vector<Slice> slices;
  // The number of slices of the other volumes if this one has fewer, because its acquisition was
  // aborted.
  std::size_t whole_count = 0;
};

struct SeriesVolumes {
  std::string difference;  // the attribute in which they differ: "EchoTime"; empty for one volume
  std::vector<SeriesVolume> volumes;
};

// Splits frames at equal positions by the attributes that distinguish them, in ascending order of
// their values; otherwise by the order of acquisition. Each mosaic is a volume. Frames at
// different positions are in different volumes if these alternate and each is evenly spaced. Frames
// of different size, spacing or orientation are in different volumes. At least two volumes of one
// lattice must be complete, or the first of two steps of a protocol, so duplicated slices alone
// cause no split.
//
// Omits nothing: if no split gives every frame its place, all frames are one volume, and make_stack
// reports the reason.
SeriesVolumes split_volumes(std::vector<Slice> slices);

}  // namespace isomesh::import::dicom
