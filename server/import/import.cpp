#include "server/import/import.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/files.h"
#include "proto/error.h"
#include "proto/volume_formats.h"
#include "server/import/archives/archive.h"
#include "server/import/peers/series.h"
#include "server/import/readers.h"
#include "server/import/source/gzip.h"

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

std::optional<std::string_view> name_of_other_format(std::string_view head) {
  const auto* found = std::ranges::find_if(kSignatures, [&](const Signature& signature) {
    return head.size() > signature.offset &&
           head.substr(signature.offset).starts_with(signature.bytes);
  });
  if (found == std::end(kSignatures)) return std::nullopt;
  return found->name;
}

// More than an empty TAR.
constexpr std::size_t kHeadBytes = 16384;

// Inflated if it is compressed. Throws if that fails: a damaged file may be of a known format.
std::string beginning_of(const InputFile& file) {
  std::string head = file.text(0, kHeadBytes);
  if (!is_gzip(head)) return head;
  inflate_range(file, {0, file.size()}, kSniffBytes, [](std::span<const std::byte>) {});
  return inflate_head(head, kHeadBytes);
}

[[noreturn]] void throw_unknown_format(const InputFile& file) {
  const std::string beginning = beginning_of(file);
  if (is_empty_tar(beginning)) throw_empty_archive();
  if (const auto name = name_of_other_format(beginning)) {
    throw Error(ErrorCode::kUnsupportedMedia,
                "This is " + std::string(*name) +
                    ", which cannot be read. Formats that can be read: " + volume_format_titles() +
                    ", or a ZIP or TAR of one, also compressed with gzip.");
  }
  throw Error(ErrorCode::kUnsupportedMedia,
              "The file is not " + volume_format_titles() +
                  ", or a ZIP or TAR of one. If it holds raw samples, give their dims (X,Y,Z) and "
                  "type.");
}

}  // namespace

Volume import_volume(const ImportTask& task, const FormatListener& listener) {
  const Input input = {.path = task.source, .companions = {}, .task = task, .listener = listener};
  if (task.options.raw) return read_raw_input(input);
  if (task.options.peers) return read_peers_series(task, listener);
  const InputFile file(task.source);
  const Reader* reader = sniff(file);
  if (reader == nullptr) throw_unknown_format(file);
  if (!task.options.member.empty() && reader->content != Content::kFiles) {
    throw invalid_parameter("member",
                            "selects a member of an archive, but this file is not an archive");
  }
  return read_input(*reader, input);
}

}  // namespace isomesh::import
