// Texts of DICOM -> UTF-8: character sets (PS3.3, C.12.1.1.2) and the escape sequences that switch
// between them (PS3.5, 6.1.2.5).
#pragma once

#include <string>
#include <string_view>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// Converts a text by the data set's Specific Character Set, its own or an inherited one (PS3.3,
// C.12.1.1.2). Values stay separated by backslashes. Invalid bytes and control characters become
// U+FFFD.
std::string utf8(const DataSet& data, Tag tag);

enum class TextKind { kText, kPersonName };

// Converts a stored text to UTF-8. `terms` is the value of Specific Character Set. Without a known
// term, bytes beyond ASCII are UTF-8 if they can be, otherwise Latin-1. Bytes without a meaning and
// control characters become U+FFFD; the result is valid UTF-8 and at most three times
// as long as `text`. Never throws because of the bytes.
std::string decoded(std::string_view text, std::string_view terms, TextKind kind);

// Loads all converters for the lifetime of the process. Call before the process drops the right to
// open files: otherwise names that are neither ASCII nor UTF-8 are lost.
void load_character_sets();

}  // namespace isomesh::import::dicom
