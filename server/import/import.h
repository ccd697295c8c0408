// Uploaded bytes -> canonical volume. This folder reads untrusted files, so only the program
// isomesh-import links it, and confines itself before it reads.
#pragma once

#include "proto/types.h"
#include "server/import/source/names.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// Writes the task's target, a canonical file, and returns the volume's other properties; id and
// created stay empty. Thread safe.
//
// Throws Error kUnsupportedMedia for an unknown format, kTooLarge beyond the limits,
// kUnusableVolume with the reason if the file is truncated, corrupt or not a volume of finite
// scalars on a regular three-dimensional lattice, kInvalidParameter if it contradicts the options;
// kOutOfSpace and kInternal if the machine fails.
//
// Leaves only the target in the scratch folder. The caller removes it if this throws.
Volume import_volume(const ImportTask& task, const FormatListener& listener = {});

}  // namespace isomesh::import
