// The last step of every import.
#pragma once

#include <cstdint>
#include <filesystem>

#include "proto/types.h"
#include "server/volume/canonical.h"
#include "server/volume/files.h"
#include "server/volume/import.h"
#include "server/volume/samples.h"

namespace isomesh::volume {

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

// The end of writing a canonical file: measures the samples, flushes them and returns `volume`, of
// which dims, type and geometry are told, with range, suggested iso-value and bytes filled in.
// Throws Error kUnusableVolume when a sample is not a finite number, kOutOfSpace, kInternal.
Volume finish(CanonicalWriter& writer, Volume volume);

// Throws Error kTooLarge when the canonical samples would exceed the limits. `sample_count` is one
// whose bytes can be counted.
void check_limits(std::uint64_t sample_count, SampleType type, const ImportLimits& limits);

}  // namespace isomesh::volume
