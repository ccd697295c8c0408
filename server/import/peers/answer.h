// What a PACS answers to a search or to what it was sent: DICOM JSON (PS3.18, F).
#pragma once

#include <filesystem>

#include "server/process/import_message.h"

namespace isomesh::import {

// Reads an answer to QIDO-RS (a list of objects) or to STOW-RS (one object with what was stored and
// what was not). An empty file is an empty list. Throws Error kPacsUnreachable when it is neither.
process::PeersAnswer read_answer(const std::filesystem::path& file);

}  // namespace isomesh::import
