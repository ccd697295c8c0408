// The last step of every import, which writes the canonical file.
#pragma once

#include <cstdint>

#include "base/files.h"
#include "proto/types.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"
#include "server/import/source/stored_samples.h"

namespace isomesh::import {

struct PlainSamples {
  const InputFile& file;
  std::uint64_t offset = 0;
  SampleLayout layout;
  bool are_labels = false;       // by their header
  bool is_segmentation = false;  // see SourceVolume
};

// Writes the canonical file of `volume`, whose dims and geometry are set and valid, to the task's
// target. Closes the ends of a segmentation (labels/closed_ends.h).
// Returns it with type, range, suggested iso-value and bytes set. Floats that are labels, declared
// in `volume`, by their header or as volume::label_count() finds them, become integers of the
// smallest type, and so do 64-bit integers that fit into 32 bits or are labels (wide_labels.h).
// Other floats lose the volume's labels. Throws Error kUnusableVolume if no sample is finite,
// kTooLarge if there is no room for the ends, kOutOfSpace, kInternal.
Volume write_canonical(const PlainSamples& samples, Volume volume, const ImportTask& task);

// Writes the canonical file of the volume `source`, whose samples are in `file` or in the data
// files of `source`. Throws Error kInvalidParameter for the option `spacing` if the file has its
// own, kUnusableVolume with a choice if neither has one, also for a flat image that is no
// segmentation, if its geometry is invalid or its samples cannot be decoded, kTooLarge beyond the
// task's limits.
Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task);

// Completes a canonical file: measures and flushes the samples. `volume` has dims, type and
// geometry; returns it with range, suggested iso-value and bytes set. Samples that are not finite
// get the smallest sample's value. So do `left_out` samples, which the caller has given it because
// they are not part of the image. The suggested iso-value leaves both out. Throws Error
// kUnusableVolume if no sample is finite, kOutOfSpace, kInternal.
Volume finish(CanonicalWriter& writer, Volume volume, std::uint64_t left_out = 0);

}  // namespace isomesh::import
