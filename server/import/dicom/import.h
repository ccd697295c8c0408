// DICOM objects -> canonical volume.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// True for bytes that begin a DICOM file, with a preamble (PS3.10) or without.
bool is_dicom(std::string_view head);

// The one volume that the images among `files` make: of slices in a file each, or of several frames
// in one. The task's options choose one of several series and volumes, and what is accepted; the
// task's source is not looked at.
// Files that are no images, and localisers, are left out and named in the volume's `ignored`. Of
// several files the client is told the names, without folders, that they have here, which are those
// of its upload.
//
// Samples are what the modality means: rescaled by slope and intercept, MONOCHROME1 as it is stored
// (no inversion), padding too. Integers stay integers where slopes and intercepts are integers.
//
// Throws Error kUnusableVolume with the reason, naming slices, when the images do not make one
// trustworthy volume, with choices when there are several and none was chosen; kTooLarge,
// kOutOfSpace, kInternal. Thread safe.
Volume import_dicom(std::span<const std::filesystem::path> files, const ImportTask& task);

// As most_file_bytes of dataset.h.
MostBytes most_dicom_bytes(const InputFile& beginning, const ImportTask& task);

// The volume of one file. Throws as import_dicom does.
Volume parse_dicom(const Input& input);

}  // namespace isomesh::import
