// Labels of 64 bits. Samples of canonical volumes have at most 32 bits, so such labels are numbered
// anew; the label of each number stands in the volume's table of labels.
#pragma once

#include <optional>

#include "proto/types.h"
#include "server/import/samples/transfer.h"

namespace isomesh::import {

// Writes the canonical file of `samples` if they are integers of which no type of 32 bits has all,
// and are labels, by their header, by the table of `volume` or by their flat regions: at most
// Volume::kMostLabels values, which become the numbers from 1 in ascending order; 0 stays 0.
// Returns the volume as finish() does, with a label for each number, and a note. Returns empty and
// writes nothing for all other samples. Throws Error kUnusableVolume for labels from 2^63, for too
// many if the header or the table declares them, and as write_canonical() does.
std::optional<Volume> write_wide_labels(const PlainSamples& samples, const Volume& volume,
                                        const ImportTask& task);

}  // namespace isomesh::import
