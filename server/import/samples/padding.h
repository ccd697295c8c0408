// Samples that a file stores but declares to be no part of its image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// Gives padding the value of the smallest other sample, so it is outside at every larger iso-value.
// `padding` has an element for each of the samples of `volume`, whose type and dims are set; one or
// more are true. Adds a note. Returns the number of samples that are no part of the image, for
// finish().
//
// Changes nothing and returns 0 if the options accept padding, with a note, and if the padding is
// the 0 around labels: their background is outside already, and must not become a label.
//
// Throws Error kUnusableVolume if all samples are padding, which the options may accept.
std::uint64_t leave_out_padding(const std::vector<bool>& padding, const ImportOptions& options,
                                std::span<std::byte> samples, Volume& volume);

}  // namespace isomesh::import
