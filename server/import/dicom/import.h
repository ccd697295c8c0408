// DICOM objects -> canonical volume.
#pragma once

#include <span>
#include <string_view>

#include "proto/types.h"
#include "server/import/dicom/choosing/named_file.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// True for the beginning of a DICOM file, with a preamble (PS3.10) or without.
bool is_dicom(std::string_view head);

// Imports the one volume among the images of `files`: single-frame slices, or frames of one file.
// The task's options select one of several series and volumes, and accept ambiguities; the task's
// source is not used. Other files and localisers are skipped and listed in the volume's `ignored`.
// With several files, messages have their names.
//
// Samples are modality values: rescaled by slope and intercept. MONOCHROME1 is not inverted.
// Padding is outside (samples/padding.h). A segmentation is closed at its ends
// (labels/closed_ends.h). Integers stay integers if slopes and intercepts are integers.
//
// Throws Error kUnusableVolume with the reason, naming slices, if the images are not one consistent
// volume, with choices if there are several and none was selected; kTooLarge, kOutOfSpace,
// kInternal. Thread safe.
Volume import_dicom(std::span<const NamedFile> files, const ImportTask& task);

// See most_file_bytes in dataset.h.
MostBytes most_dicom_bytes(const InputFile& beginning, const ImportTask& task);

// Imports a single file. Throws as import_dicom does.
Volume parse_dicom(const Input& input);

}  // namespace isomesh::import
