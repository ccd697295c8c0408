// The last step of every import, which writes the canonical file.
#pragma once

#include <cstdint>
#include <filesystem>

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
  bool are_labels = false;      // by their header
  bool labels_if_flat = false;  // see SourceVolume
};

// Writes the canonical file `target` of `volume`, whose dims and geometry are set and valid.
// Returns it with type, range, suggested iso-value and bytes set. Floats that are labels, declared
// in `volume`, by their header or as volume::label_count() finds them, become integers of the
// smallest type, and so do 64-bit integers that fit into 32 bits. Other floats lose the volume's
// labels. Throws Error kUnusableVolume if a sample is not finite, kOutOfSpace, kInternal.
Volume write_canonical(const PlainSamples& samples, Volume volume,
                       const std::filesystem::path& target);

// Writes the canonical file of the volume `source`, whose samples are in `file` or in the data
// files of `source`. Throws Error kInvalidParameter for the option `spacing` if the file has its
// own, kUnusableVolume with a choice if neither has one, also for a flat image, if its geometry
// is invalid or its samples cannot be decoded, kTooLarge beyond the task's limits.
Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task);

// Throws Error kInvalidParameter for the option `spacing` of a file that has its own.
void refuse_spacing(const ImportOptions& options);

// Completes a canonical file: measures and flushes the samples. `volume` has dims, type and
// geometry; returns it with range, suggested iso-value and bytes set. Throws Error kUnusableVolume
// if a sample is not finite, kOutOfSpace, kInternal.
Volume finish(CanonicalWriter& writer, Volume volume);

}  // namespace isomesh::import
