#include "server/import/other_formats.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

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
    {"BZh"sv, "a file compressed with bzip2"},
};

}  // namespace

std::optional<std::string_view> name_of_other_format(std::string_view head) {
  const auto* found = std::ranges::find_if(kSignatures, [&](const Signature& signature) {
    return head.size() > signature.offset &&
           head.substr(signature.offset).starts_with(signature.bytes);
  });
  if (found == std::end(kSignatures)) return std::nullopt;
  return found->name;
}

}  // namespace isomesh::import
