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
  bool labels_if_flat = false;   // see SourceVolume
};

// Writes the canonical file of `volume`, whose dims and geometry are set and valid, to the task's
// target. Returns it as finish() does. Integers of 64 bits that are labels are numbered anew
// (wide_labels.h). Floats that are no labels lose the volume's labels. Throws Error kUnusableVolume
// if no sample is finite, kTooLarge if there is no room for the ends, kOutOfSpace, kInternal.
Volume write_canonical(const PlainSamples& samples, Volume volume, const ImportTask& task);

// Writes the canonical file of the volume `source`, whose samples are in `file` or in the data
// files of `source`. Throws Error kInvalidParameter for the option `spacing` if the file has its
// own, kUnusableVolume with a choice if neither has one, also for a flat image that is no
// segmentation, if its geometry is invalid or its samples cannot be decoded, kTooLarge beyond the
// task's limits.
Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task);

// Makes the order of axes canonical (volume/geometry.h): that of the samples, with which the file
// begins, and of dims and geometry of `volume`. Tells the order until then in `stored_axes`, unless
// that is known. Changes nothing if it was done before. The header of the file remains to be
// written. Throws Error kUnusableVolume.
void put_in_order(CanonicalWriter& writer, Volume& volume);

struct SampleKind {
  bool are_labels = false;  // by their header
  bool are_wide = false;    // stored as integers of 64 bits
  // The ends are closed, if the samples are integers: the file was made with_room()
  // (labels/closed_ends.h).
  bool is_segmentation = false;
  // Samples that are not part of the image, to which the caller gave the smallest sample's value.
  std::uint64_t left_out = 0;
};

// Completes a canonical file, which begins with the samples of `volume`: puts them in order,
// measures and flushes them. `volume` has dims, type and geometry; returns it with range, suggested
// iso-value and bytes set. Samples that are not finite get the smallest sample's value; the
// suggested iso-value leaves them and `left_out` samples out. Floats that are labels become
// integers of the smallest type: those that `volume` or `kind` declares, and those that
// volume::mask_value() or label_count() recognises, if all are nearly whole. So do wide integers
// that fit into 32 bits. Throws Error kUnusableVolume if no sample is finite, kOutOfSpace,
// kInternal.
Volume finish(CanonicalWriter& writer, Volume volume, const SampleKind& kind = {});

}  // namespace isomesh::import
