// Uploaded bytes -> canonical volume. The code of this folder reads untrusted files, so only the
// program isomesh-import is linked with it, which confines itself before it reads.
#pragma once

#include "proto/types.h"
#include "server/import/source/names.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// Writes the task's target, a canonical file, and returns what else is known of the volume; id and
// created stay empty. Thread safe.
//
// Throws Error kUnsupportedMedia when the file is of no format that is read, kTooLarge when its
// samples exceed the limits, kUnusableVolume with the reason when it is truncated, corrupt or not a
// volume of finite scalars on a regular three-dimensional lattice, kInvalidParameter when it is not
// what the options say. Throws kOutOfSpace and kInternal when the machine fails.
//
// Leaves no file but the target in the scratch folder. The caller removes the target when this
// throws.
Volume import_volume(const ImportTask& task, const FormatListener& listener = {});

}  // namespace isomesh::import
