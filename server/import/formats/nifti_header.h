// The header fields of NIfTI-1, NIfTI-2 and Analyze 7.5 that a volume needs, and the extensions
// between a header and the samples
// (https://nifti.nimh.nih.gov/nifti-1/documentation/nifti1fields/nifti1fields_pages/extension.html).
// Internal to the reader.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "proto/types.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// Enough leading bytes for the header of any version.
inline constexpr std::size_t kNiftiHeaderBytes = 540;

// In this machine's byte order.
struct NiftiHeader {
  bool big_endian = false;
  bool is_analyze = false;  // an Analyze header, without a position in space
  int analyze_orient = 0;   // the slices' direction in an Analyze header, by its manual
  std::array<std::int64_t, 3> spm_origin = {};  // SPM's in an Analyze header, counted from 1; or 0
  bool is_detached = false;                     // the samples are in another file
  std::int64_t bytes = 0;                       // of the header
  std::array<std::int64_t, 8> dim = {};
  std::array<double, 8> pixdim = {};
  int intent = 0;
  int datatype = 0;
  int bits = 0;
  double vox_offset = 0;
  double slope = 0;
  double intercept = 0;
  int units = 0;
  int qform_code = 0;
  int sform_code = 0;
  std::array<double, 3> quaternion = {};
  Vector3 qoffset = {};
  std::array<double, 12> srow = {};  // row-major, 3 x 4
  // Fields without a meaning that were read as nibabel and ITK read them: a sentence each.
  std::vector<std::string> corrections;
};

// True if a file of one of the three begins so. Analyze's header, without a magic number, is
// recognised by its size field and by fields with few possible values, or by a size of 348 bytes.
// A NIfTI-1 header may have another size field.
// So `head` must have more bytes of a larger file.
bool begins_as_nifti(std::string_view head);

// Corrects single fields that contradict the others. Throws Error kUnusableVolume.
NiftiHeader read_nifti_header(std::string_view head);

// The labels of one of the file's volumes, as label_table() returns them: from Caret's LabelTable,
// which TotalSegmentator and others write too, or from AFNI's VALUE_LABEL_DTABLE. Other and damaged
// extensions are ignored, because their content is private to programs. `end` bounds the
// extensions. Throws Error kUnusableVolume if there are too many labels.
std::vector<LabelEntry> nifti_labels(const InputFile& file, const NiftiHeader& header,
                                     std::uint64_t end, std::uint64_t volume);

}  // namespace isomesh::import
