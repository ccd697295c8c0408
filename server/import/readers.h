// The table of supported formats.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/import/source/reader.h"

namespace isomesh::import {

std::span<const Reader* const> readers();

// Recognises a file's format by its first bytes, also inside gzip; never by its name. Null if
// unknown. Thread safe.
const Reader* sniff(std::string_view head);
const Reader* sniff(const InputFile& file);

// The largest possible size of a file with this beginning (kBeginningBytes), plain or compressed as
// a whole. Not for archives. Throws as import_volume does.
MostBytes most_bytes_of(const Reader& reader, const InputFile& beginning, const ImportTask& task);

// The data files that a header names, plain or compressed. Throws as import_volume does.
std::vector<std::string> data_names_of(const Reader& reader, const InputFile& beginning,
                                       const Companions& companions, const ImportTask& task);

// Reads an input, plain or compressed as a whole. Throws as import_volume does.
Volume read_input(const Reader& reader, Input input);

Volume read_raw_input(const Input& input);

}  // namespace isomesh::import
