// DICOM objects -> canonical volume.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "proto/types.h"
#include "server/volume/import.h"

namespace isomesh::volume {

// True for bytes that begin a DICOM file, with a preamble (PS3.10) or without.
bool is_dicom(std::span<const std::byte> head);

// The one volume that the images among `files` make: of slices in a file each, or of several frames
// in one. `series` names the SeriesInstanceUID to take; it may be empty when there is only one.
// Files that are no images, and localisers, are left out and named in the volume's `ignored`. Files
// are named to the client as they are here, without folders, unless there is only one: it knows
// them from its upload. Temporary files lie beside `target`.
//
// Samples are what the modality means: rescaled by slope and intercept, MONOCHROME1 as it is stored
// (no inversion), padding too. Integers stay integers where slopes and intercepts are integers.
//
// Throws Error kUnusableVolume with the reason, naming slices, when the images do not make one
// trustworthy volume, and with one entry in `fields` per series, when there are several and
// `series` names none of them; kTooLarge, kOutOfSpace, kInternal. Thread safe.
Volume import_dicom(std::span<const std::filesystem::path> files, const std::string& series,
                    const ImportLimits& limits, const std::filesystem::path& target);

}  // namespace isomesh::volume
