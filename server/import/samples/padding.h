// Samples that a file stores but declares to be no part of its image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/types.h"
#include "server/import/source/names.h"
#include "server/import/source/sample_set.h"

namespace isomesh::import {

// Gives padding the value of the smallest other sample, so it is below every larger iso-value.
// `padding` is not empty, and of the samples of `volume`, whose type and dims are set. Adds a note.
// Returns the number of samples that are no part of the image, for finish().
//
// Changes nothing and returns 0 if the options accept padding, with a note, and if the padding is
// the 0 around labels: their background is outside already, and must not become a label.
//
// Throws Error kUnusableVolume if all samples are padding, which the options may accept.
std::uint64_t leave_out_padding(const SampleSet& padding, const ImportOptions& options,
                                std::span<std::byte> samples, Volume& volume);

}  // namespace isomesh::import
