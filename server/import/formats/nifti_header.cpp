#include "server/import/formats/nifti_header.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "server/import/labels/label_table.h"
#include "server/import/labels/label_text.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kNifti1Bytes = 348;
constexpr std::size_t kNifti2Bytes = 540;

constexpr std::int64_t kFlagBytes = 4;  // the first tells whether there are extensions

enum class Version { kOne, kTwo };

struct Kind {
  Version version = Version::kOne;
  bool big_endian = false;
  bool detached = false;
  bool is_analyze = false;
  bool has_other_size = false;  // in its first field
};

// Analyze has no magic number, so its header is checked more strictly: a known datatype with its
// bits, possible sizes of one to seven axes, and "regular" as in its manual. Some writers, such as
// nibabel, leave out the last. Then the file must be a header alone, as Analyze's are.
bool is_analyze(const HeaderBytes& fields, std::size_t bytes) {
  struct Row {
    int datatype;
    int bits;
  };
  static constexpr Row kTypes[] = {{2, 8}, {4, 16}, {8, 32}, {16, 32}, {64, 64}, {132, 16}};
  const auto axes = fields.at<std::int16_t>(40);
  const auto is_its_type = [&](const Row& row) {
    return fields.at<std::int16_t>(70) == row.datatype && fields.at<std::int16_t>(72) == row.bits;
  };
  if (axes < 1 || axes > 7 || !std::ranges::any_of(kTypes, is_its_type)) return false;
  if (fields.at<char>(38) == 'r') return true;
  std::array<std::int16_t, 7> sizes = {};
  fields.read<std::int16_t>(42, sizes);
  std::array<float, 3> steps = {};
  fields.read<float>(80, steps);
  const auto used = std::span(sizes).first(static_cast<std::size_t>(axes));
  return bytes == kNifti1Bytes && std::ranges::all_of(used, [](int size) { return size > 0; }) &&
         std::ranges::all_of(steps, [](float step) { return std::isfinite(step); });
}

// Some programs leave the size of the header at 0. Then its dimensions tell the byte order.
bool begins_at_magic(std::string_view head, bool big_endian) {
  using std::string_view_literals::operator""sv;
  const std::string_view magic = head.substr(344, 4);
  const auto axes = HeaderBytes(head, big_endian).at<std::int16_t>(40);
  return (magic == "n+1\0"sv || magic == "ni1\0"sv) && axes >= 1 && axes <= 7;
}

std::optional<Kind> kind_of(std::string_view head) {
  using std::string_view_literals::operator""sv;
  if (head.size() < kNifti1Bytes) return std::nullopt;
  for (const bool big_endian : {false, true}) {
    const auto size = HeaderBytes(head, big_endian).at<std::int32_t>(0);
    if (size == kNifti1Bytes) {
      const std::string_view magic = head.substr(344, 4);
      if (magic == "n+1\0"sv || magic == "ni1\0"sv) {
        return Kind{Version::kOne, big_endian, magic == "ni1\0"sv};
      }
      if (is_analyze(HeaderBytes(head, big_endian), head.size()))
        return Kind{Version::kOne, big_endian, true, true};
    }
    if (size != kNifti1Bytes && size != kNifti2Bytes && begins_at_magic(head, big_endian)) {
      return Kind{Version::kOne, big_endian, head.substr(344, 4) == "ni1\0"sv, false, true};
    }
    if (size == kNifti2Bytes) {
      const std::string_view magic = head.substr(4, 4);
      if (magic == "n+2\0"sv || magic == "ni2\0"sv) {
        return Kind{Version::kTwo, big_endian, magic == "ni2\0"sv};
      }
    }
  }
  return std::nullopt;
}

NiftiHeader read_nifti1(const HeaderBytes& fields) {
  NiftiHeader header;
  fields.read<std::int16_t>(40, header.dim);
  header.intent = fields.at<std::int16_t>(68);
  header.datatype = fields.at<std::int16_t>(70);
  header.bits = fields.at<std::int16_t>(72);
  fields.read<float>(76, header.pixdim);
  header.vox_offset = fields.at<float>(108);
  header.slope = fields.at<float>(112);
  header.intercept = fields.at<float>(116);
  header.units = fields.at<std::uint8_t>(123);
  header.qform_code = fields.at<std::int16_t>(252);
  header.sform_code = fields.at<std::int16_t>(254);
  fields.read<float>(256, header.quaternion);
  fields.read<float>(268, header.qoffset);
  fields.read<float>(280, header.srow);
  return header;
}

NiftiHeader read_nifti2(const HeaderBytes& fields) {
  NiftiHeader header;
  header.datatype = fields.at<std::int16_t>(12);
  header.bits = fields.at<std::int16_t>(14);
  fields.read<std::int64_t>(16, header.dim);
  fields.read<double>(104, header.pixdim);
  header.vox_offset = static_cast<double>(fields.at<std::int64_t>(168));
  header.slope = fields.at<double>(176);
  header.intercept = fields.at<double>(184);
  header.qform_code = fields.at<std::int32_t>(344);
  header.sform_code = fields.at<std::int32_t>(348);
  fields.read<double>(352, header.quaternion);
  fields.read<double>(376, header.qoffset);
  fields.read<double>(400, header.srow);
  header.units = fields.at<std::int32_t>(500);
  header.intent = fields.at<std::int32_t>(504);
  return header;
}

// Analyze has fields with other meanings in place of NIfTI's.
void forget_what_is_no_analyze(NiftiHeader& header) {
  constexpr int kUint16OfSpm = 132;
  constexpr int kUint16 = 512;
  if (header.datatype == kUint16OfSpm) header.datatype = kUint16;
  header.intent = 0;
  header.intercept = 0;
  header.units = 0;
  header.qform_code = 0;
  header.sform_code = 0;
  for (double& size : header.pixdim) size = std::abs(size);
}

// The bits of each datatype of the formats.
int bits_of(int datatype) {
  struct Row {
    int datatype;
    int bits;
  };
  static constexpr Row kRows[] = {{2, 8},   {4, 16},   {8, 32},   {16, 32},   {64, 64},
                                  {256, 8}, {512, 16}, {768, 32}, {1024, 64}, {1280, 64}};
  const auto* found = std::ranges::find(kRows, datatype, &Row::datatype);
  return found == std::end(kRows) ? 0 : found->bits;
}

void correct_bits(NiftiHeader& header) {
  const int bits = bits_of(header.datatype);
  if (bits == 0 || header.bits == 0 || header.bits == bits) return;
  header.corrections.push_back("Its bitpix is " + std::to_string(header.bits) +
                               ", but its datatype " + std::to_string(header.datatype) + " has " +
                               std::to_string(bits) + " bits, which were read.");
}

void correct_slope(NiftiHeader& header) {
  if (!std::isinf(header.slope)) return;
  header.corrections.push_back("Its slope is " + to_text(header.slope) +
                               ", so no slope was applied.");
  header.slope = 0;
}

void correct_unit(NiftiHeader& header) {
  constexpr int kSpatialUnits = 7;
  constexpr int kMillimetres = 2;
  constexpr int kLastKnown = 3;
  const int unit = header.units & kSpatialUnits;
  if (unit <= kLastKnown) return;
  header.corrections.push_back("Its spatial unit " + std::to_string(unit) +
                               " is unknown and was read as millimetres.");
  header.units = header.units - unit + kMillimetres;
}

// Beyond the third axis.
void correct_sizes(NiftiHeader& header) {
  for (std::int64_t axis = 4; axis <= std::min<std::int64_t>(header.dim[0], 7); ++axis) {
    std::int64_t& size = header.dim.at(static_cast<std::size_t>(axis));
    if (size != 0) continue;
    size = 1;
    header.corrections.push_back("Its size along axis " + std::to_string(axis) +
                                 " is 0 and was read as 1.");
  }
}

// Without an offset, the samples are behind the header and its four flags of extensions.
void correct_offset(NiftiHeader& header) {
  if (header.is_detached || !std::isfinite(header.vox_offset)) return;
  const double said = header.vox_offset;
  const double offset =
      said == 0 ? static_cast<double>(header.bytes + kFlagBytes) : std::floor(said);
  if (offset == said) return;
  header.vox_offset = offset;
  header.corrections.push_back("Its vox_offset is " + to_text(said) +
                               "; the samples were read from byte " + to_text(offset) + " on.");
}

// Room for 65 535 labels with long names; the rest is ignored.
constexpr std::uint64_t kMostExtensionBytes = std::uint64_t{16} << 20;
constexpr std::size_t kHeadBytes = 8;  // size and code

std::string_view text_of(std::string_view data) { return data.substr(0, data.find('\0')); }

bool may_have_labels(std::string_view text) {
  return text.find("LabelTable") != text.npos || text.find("VALUE_LABEL_DTABLE") != text.npos;
}

}  // namespace

bool begins_as_nifti(std::string_view head) { return kind_of(head).has_value(); }

NiftiHeader read_nifti_header(std::string_view head) {
  const auto kind = kind_of(head);
  if (!kind) throw_unusable("The NIfTI header is damaged.");
  if (kind->version == Version::kTwo && head.size() < kNifti2Bytes) {
    throw_unusable("The file ends within its NIfTI-2 header.");
  }
  const HeaderBytes fields(head, kind->big_endian);
  NiftiHeader header = kind->version == Version::kOne ? read_nifti1(fields) : read_nifti2(fields);
  header.big_endian = kind->big_endian;
  header.bytes = kind->version == Version::kOne ? kNifti1Bytes : kNifti2Bytes;
  header.is_detached = kind->detached;
  header.is_analyze = kind->is_analyze;
  if (kind->is_analyze) {
    header.analyze_orient = fields.at<std::uint8_t>(252);
    fields.read<std::int16_t>(253, header.spm_origin);
    forget_what_is_no_analyze(header);
  }
  if (kind->has_other_size) {
    header.corrections.push_back("Its first field, the size of the header, is " +
                                 std::to_string(fields.at<std::int32_t>(0)) + " instead of 348.");
  }
  correct_bits(header);
  correct_slope(header);
  correct_unit(header);
  correct_sizes(header);
  correct_offset(header);
  return header;
}

std::vector<LabelEntry> nifti_labels(const InputFile& file, const NiftiHeader& header,
                                     std::uint64_t end, std::uint64_t volume) {
  const auto begin = static_cast<std::uint64_t>(header.bytes);
  constexpr auto kFlags = static_cast<std::size_t>(kFlagBytes);
  if (header.is_analyze || end < begin + kFlags + kHeadBytes) return {};
  const std::string bytes = file.text(begin, std::min(end - begin, kMostExtensionBytes));
  if (bytes.size() < kFlags || bytes[0] == '\0') return {};
  std::string_view rest = std::string_view(bytes).substr(kFlags);
  std::vector<LabelEntry> entries;
  while (rest.size() >= kHeadBytes) {
    const std::uint32_t size = HeaderBytes(rest, header.big_endian).at<std::uint32_t>(0);
    if (size < kHeadBytes || size > rest.size()) break;
    // Recognised by content, not by code: some programs write Caret's as a comment, or without a
    // code.
    const std::string_view text = text_of(rest.substr(kHeadBytes, size - kHeadBytes));
    if (may_have_labels(text)) {
      for (LabelEntry& entry : labels_of_xml(text, volume)) entries.push_back(std::move(entry));
    }
    // Bounds memory for many extensions with many labels.
    if (entries.size() > Volume::kMostLabels) break;
    rest.remove_prefix(size);
  }
  return label_table(std::move(entries));
}

}  // namespace isomesh::import
