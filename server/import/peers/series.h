// A series as a PACS sends it, to one volume.
#pragma once

#include "proto/types.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// Reads the task's source, which is multipart/related with one DICOM file a part, as the task's
// options say of what series. Objects that came twice are read once. Throws Error kSeriesIncomplete
// when it is not whole, holds an object of another series or study, or other objects than were
// listed; and what import_volume throws of the images themselves.
Volume read_peers_series(const ImportTask& task, const FormatListener& listener);

}  // namespace isomesh::import
