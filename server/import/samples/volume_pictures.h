// Questions about a file of several volumes, with a picture of each.
#pragma once

#include <filesystem>

#include "base/files.h"
#include "proto/error.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Returns the error, which offers the volumes of a file, with the middle slice of each, all by the
// window of the first; `source` describes the first. They are smaller the more there are. Without
// pictures if the samples are not plain and one volume after the other, or cannot be read.
Error with_pictures(const Error& error, const InputFile& file, const SourceVolume& source,
                    const std::filesystem::path& scratch);

}  // namespace isomesh::import
