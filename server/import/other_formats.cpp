#include "server/import/other_formats.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>

#include "base/text.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

using std::string_view_literals::operator""sv;

struct Signature {
  std::string_view bytes;
  std::string_view name;
  std::size_t offset = 0;
};

constexpr Signature kSignatures[] = {
    {"ZISRAWFILE"sv, "a CZI file of Zeiss"},
    {"\xda\xce\xbe\x0a"sv, "an ND2 file of Nikon"},
    {"\x70\0\0\0"sv, "a LIF file of Leica"},
    {"# AmiraMesh"sv, "an Amira file"},
    {"# Avizo"sv, "an Avizo file"},
    {"# HyperSurface"sv, "a surface of Amira"},
    {"CDF\1"sv, "a netCDF file, such as MINC 1"},
    {"CDF\2"sv, "a netCDF file, such as MINC 1"},
    {"raw_image_stack_by_hpeng"sv, "a Vaa3D file"},
    {" BDV"sv, "an OpenVDB file"},
    {"\0\0\0\3"sv, "a DM3 file of DigitalMicrograph"},
    {"\0\0\0\4"sv, "a DM4 file of DigitalMicrograph"},
    {"MATLAB 5.0 MAT-file"sv, "a MAT file of MATLAB"},
    {"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"sv, "an OLE file, such as OIB, ZVI or TXM"},
    {"\xff\xff\xfe"sv, "a surface of FreeSurfer"},
    {"glTF"sv, "a surface (GLB)"},
    {"ply\n"sv, "a surface (PLY)"},
    {"ply\r"sv, "a surface (PLY)"},
    {"solid "sv, "a surface (STL)"},
    {"\x00\x00\x00\x0cjP  "sv, "a JPEG 2000 image"},
    {"\xff\xd8\xff"sv, "a JPEG image"},
    {"GIF8"sv, "a GIF image"},
    {"WEBP"sv, "a WebP image", 8},
    {"AVI "sv, "a video (AVI)", 8},
    {"ftyp"sv, "a video or image (MP4)", 4},
    {"%PDF-"sv, "a PDF document"},
    {"7z\xbc\xaf\x27\x1c"sv, "a 7-Zip archive"},
    {"Rar!\x1a\x07"sv, "a RAR archive"},
    {"\xfd"
     "7zXZ"sv,
     "a file compressed with xz"},
    {"\x28\xb5\x2f\xfd"sv, "a file compressed with Zstandard"},
    {"MATRIX7"sv, "an ECAT 7 file"},
    {"<nifti_image"sv, "a NIfTI file in ASCII (.nia)"},
    {"\x08\0\0\0\x04\0\0\0"sv, "an ACR-NEMA file"},
    {"\0\x08\0\0\0\0\0\x04"sv, "an ACR-NEMA file"},
    {"BZh"sv, "a file compressed with bzip2"},
};

// Two bytes are few, so other fields must be plausible, too.
bool is_bio_rad(std::string_view head) {
  constexpr std::size_t kHeaderBytes = 76;
  constexpr std::uint16_t kNumber = 12345;
  if (head.size() < kHeaderBytes) return false;
  const HeaderBytes header(head, false);
  return header.at<std::uint16_t>(54) == kNumber && header.at<std::uint16_t>(14) <= 1 &&
         header.at<std::uint16_t>(0) > 0 && header.at<std::uint16_t>(2) > 0 &&
         header.at<std::uint16_t>(4) > 0;
}

bool is_interfile(std::string_view head) {
  return lower(trimmed(head).substr(0, 10)) == "!interfile";
}

// DICOM's predecessor has no preamble, and this code near its beginning.
bool is_acr_nema(std::string_view head) {
  constexpr std::size_t kNear = 256;
  return head.substr(0, kNear).find("ACR-NEMA") != std::string_view::npos;
}

// JSON, or the same in CBOR.
bool is_itk_wasm(std::string_view head) {
  return head.find("imageType") != std::string_view::npos &&
         head.find("componentType") != std::string_view::npos;
}

// The metadata of an array, an array without a picture's metadata, or of a group without any.
bool is_zarr(std::string_view head) {
  return head.starts_with('{') && head.find("\"zarr_format\"") != std::string_view::npos;
}

struct Recognised {
  bool (*is_format)(std::string_view head);
  std::string_view name;
};

constexpr Recognised kRecognised[] = {
    {is_interfile, "an Interfile header"},
    {is_acr_nema, "an ACR-NEMA file"},
    {is_itk_wasm, "an image of itk-wasm (.iwi)"},
    {is_zarr, "a Zarr without the `multiscales` of OME"},
    {is_bio_rad, "a PIC file of Bio-Rad"},
};

}  // namespace

std::optional<std::string_view> name_of_other_format(std::string_view head) {
  const auto* found = std::ranges::find_if(kSignatures, [&](const Signature& signature) {
    return head.size() > signature.offset &&
           head.substr(signature.offset).starts_with(signature.bytes);
  });
  if (found != std::end(kSignatures)) return found->name;
  const auto* recognised = std::ranges::find_if(
      kRecognised, [&](const Recognised& each) { return each.is_format(head); });
  if (recognised != std::end(kRecognised)) return recognised->name;
  return std::nullopt;
}

}  // namespace isomesh::import
