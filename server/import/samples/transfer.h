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

// Plain samples in a file.
struct PlainSamples {
  const InputFile& file;
  std::uint64_t offset = 0;
  SampleLayout layout;
};

// Writes the canonical file `target` of `volume`, of which dims and geometry are told and usable,
// and returns it with type, range, suggested iso-value and bytes filled in.
// Throws Error kUnusableVolume when a sample is not a finite number, kOutOfSpace, kInternal.
Volume write_canonical(const PlainSamples& samples, Volume volume,
                       const std::filesystem::path& target);

// Writes the canonical file of the volume that a header describes as `source`, whose samples lie in
// `file` or in the files that `source` names. Throws Error kUnusableVolume also when its geometry
// cannot be used or its samples cannot be decoded, kTooLarge beyond the task's limits.
Volume write_canonical(const InputFile& file, const SourceVolume& source, const ImportTask& task);

// The end of writing a canonical file: measures the samples, flushes them and returns `volume`, of
// which dims, type and geometry are told, with range, suggested iso-value and bytes filled in.
// Throws Error kUnusableVolume when a sample is not a finite number, kOutOfSpace, kInternal.
Volume finish(CanonicalWriter& writer, Volume volume);

}  // namespace isomesh::import
