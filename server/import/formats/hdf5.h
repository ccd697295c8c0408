// Images in HDF5: those of ITK and MINC 2 (https://en.wikibooks.org/wiki/MINC/Reference).
#pragma once

#include <string_view>

#include "server/import/source/reader.h"

namespace isomesh::import {

bool is_hdf5(std::string_view head);

// Reads the image and writes the task's target. MINC's integers become real values by the range of
// each slice; they stay integers if that changes nothing. The options select one of several
// instants. Throws as import_volume does; Error kUnsupportedMedia for HDF5 files of other programs.
Volume parse_hdf5(const Input& input);

// The position of the samples in the file is unknown, so this is the limit for any volume.
MostBytes most_hdf5_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
