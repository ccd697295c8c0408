// The table of the formats that are read.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "server/import/reader.h"

namespace isomesh::import {

std::span<const Reader> readers();

// Tells a file's format from its first bytes, looking into gzip; null when it is none of ours.
// Never from a name. Thread safe.
const Reader* sniff(std::span<const std::byte> head);
const Reader* sniff(const InputFile& file);

// Reads an input that may be compressed as a whole. Throws as import_volume does.
Volume read_input(const Reader& reader, Input input);

// Reads an input as the raw samples that its task's options describe.
Volume read_raw_input(const Input& input);

}  // namespace isomesh::import
