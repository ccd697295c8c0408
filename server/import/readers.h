// The table of the formats that are read.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/import/source/reader.h"

namespace isomesh::import {

std::span<const Reader> readers();

// Tells a file's format from its first bytes, looking into gzip; null when it is none of ours.
// Never from a name. Thread safe.
const Reader* sniff(std::span<const std::byte> head);
const Reader* sniff(const InputFile& file);

// How many bytes a file of the format may have, itself or compressed as a whole, that begins with
// what `beginning` holds (kBeginningBytes). Not for archives. Throws as import_volume does.
MostBytes most_bytes_of(const Reader& reader, const InputFile& beginning, const ImportTask& task);

// The data files that such a file names, itself or compressed. Throws as import_volume does.
std::vector<std::string> data_names_of(const Reader& reader, const InputFile& beginning,
                                       const Companions& companions, const ImportTask& task);

// Reads an input that may be compressed as a whole. Throws as import_volume does.
Volume read_input(const Reader& reader, Input input);

// Reads an input as the raw samples that its task's options describe.
Volume read_raw_input(const Input& input);

}  // namespace isomesh::import
