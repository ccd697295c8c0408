#include "tests/unit/import/dicom/objects.h"

#include <algorithm>
#include <stdexcept>

#include <gdcmImage.h>
#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmSequenceOfFragments.h>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/import.h"
#include "tests/support/deflate.h"

namespace isomesh::import::test {
namespace {

constexpr std::uint32_t kUndefined = 0xFFFFFFFF;

std::string number(std::uint64_t value, std::size_t bytes, bool big_endian) {
  std::string result;
  for (std::size_t i = 0; i < bytes; ++i) {
    const std::size_t shift = 8 * (big_endian ? bytes - 1 - i : i);
    result += static_cast<char>(value >> shift & 0xFF);
  }
  return result;
}

std::string tag_bytes(dicom::Tag tag, bool big_endian) {
  return number(tag >> 16, 2, big_endian) + number(tag & 0xFFFF, 2, big_endian);
}

bool has_long_length(std::string_view vr) {
  return vr == "OB" || vr == "OW" || vr == "SQ" || vr == "UN" || vr == "UT" || vr == "OF" ||
         vr == "OD";
}

std::string head(dicom::Tag tag, std::string_view vr, std::uint32_t length, bool is_explicit,
                 bool big_endian) {
  std::string result = tag_bytes(tag, big_endian);
  if (!is_explicit) return result + number(length, 4, big_endian);
  result += vr;
  if (!has_long_length(vr)) return result + number(length, 2, big_endian);
  return result + std::string(2, '\0') + number(length, 4, big_endian);
}

std::string swapped(std::string bytes, unsigned word) {
  for (std::size_t at = 0; at + word <= bytes.size(); at += word) {
    std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                 bytes.begin() + static_cast<std::ptrdiff_t>(at + word));
  }
  return bytes;
}

std::string joined(std::initializer_list<double> numbers) {
  std::string text;
  for (const double each : numbers) text += (text.empty() ? "" : "\\") + to_text(each);
  return text;
}

std::string joined(const Vector3& v) { return joined({v[0], v[1], v[2]}); }

std::string joined(const Vector3& a, const Vector3& b) { return joined(a) + '\\' + joined(b); }

}  // namespace

DicomObject& DicomObject::text(dicom::Tag tag, std::string_view vr, std::string_view value) {
  Value& element = values_[tag] = {};
  element.vr = vr;
  element.bytes = value;
  if (value.size() % 2 != 0) element.bytes += vr == "UI" ? '\0' : ' ';
  return *this;
}

DicomObject& DicomObject::number(dicom::Tag tag, unsigned value) {
  Value& element = values_[tag] = {};
  element.vr = "US";
  element.bytes = test::number(value, 2, false);
  element.bytes_per_word = 2;
  return *this;
}

DicomObject& DicomObject::numbers(dicom::Tag tag, const std::array<unsigned, 3>& values) {
  number(tag, values[0]);
  for (const unsigned value : {values[1], values[2]}) {
    values_[tag].bytes += test::number(value, 2, false);
  }
  return *this;
}

DicomObject& DicomObject::bytes(dicom::Tag tag, std::string_view vr, std::string value) {
  Value& element = values_[tag] = {};
  element.vr = vr;
  element.bytes = std::move(value);
  return *this;
}

DicomObject& DicomObject::items(dicom::Tag tag, std::vector<DicomObject> items) {
  Value& element = values_[tag] = {};
  element.vr = "SQ";
  element.items = std::move(items);
  return *this;
}

DicomObject& DicomObject::pixels(std::string bytes, unsigned bytes_per_word) {
  Value& element = values_[dicom::kPixelData] = {};
  element.vr = "OW";
  element.bytes = std::move(bytes);
  if (element.bytes.size() % 2 != 0) element.bytes += '\0';
  element.bytes_per_word = std::max(bytes_per_word, 2U);
  return *this;
}

DicomObject& DicomObject::fragments(std::vector<std::string> fragments,
                                    std::vector<std::uint32_t> offsets) {
  Value& element = values_[dicom::kPixelData] = {};
  element.vr = "OB";
  element.is_encapsulated = true;
  element.fragments = std::move(fragments);
  element.offsets = std::move(offsets);
  return *this;
}

DicomObject& DicomObject::erase(dicom::Tag tag) {
  values_.erase(tag);
  return *this;
}

std::string DicomObject::element(dicom::Tag tag, const Value& value, bool is_explicit,
                                 bool big_endian) {
  const auto item = [&](dicom::Tag item_tag, std::uint32_t length) {
    return head(item_tag, "", length, false, big_endian);
  };
  if (value.is_encapsulated) {
    std::string result = head(tag, "OB", kUndefined, is_explicit, big_endian);
    result += item(dicom::kItem, static_cast<std::uint32_t>(value.offsets.size() * 4));
    for (const std::uint32_t offset : value.offsets) result += test::number(offset, 4, false);
    for (const std::string& fragment : value.fragments) {
      result += item(dicom::kItem, static_cast<std::uint32_t>(fragment.size())) + fragment;
    }
    return result + item(dicom::kSequenceEnd, 0);
  }
  if (value.vr == "SQ") {
    std::string content;
    for (const DicomObject& each : value.items) {
      const std::string bytes = each.data_set(is_explicit, big_endian);
      content +=
          item(dicom::kItem, is_explicit ? kUndefined : static_cast<std::uint32_t>(bytes.size())) +
          bytes + (is_explicit ? item(dicom::kItemEnd, 0) : "");
    }
    if (is_explicit) content += item(dicom::kSequenceEnd, 0);
    const auto length = is_explicit ? kUndefined : static_cast<std::uint32_t>(content.size());
    return head(tag, "SQ", length, is_explicit, big_endian) + content;
  }
  return head(tag, value.vr, static_cast<std::uint32_t>(value.bytes.size()), is_explicit,
              big_endian) +
         (big_endian ? swapped(value.bytes, value.bytes_per_word) : value.bytes);
}

std::string DicomObject::data_set(bool is_explicit, bool big_endian) const {
  std::string result;
  for (const auto& [tag, value] : values_) result += element(tag, value, is_explicit, big_endian);
  return result;
}

std::string DicomObject::file(std::string_view transfer_syntax) const {
  DicomObject meta;
  meta.text(dicom::kTransferSyntaxUid, "UI", transfer_syntax);
  return std::string(128, '\0') + "DICM" + meta.data_set(true, false) + bare(transfer_syntax);
}

std::string DicomObject::bare(std::string_view transfer_syntax) const {
  const std::string data = data_set(transfer_syntax != kImplicit, transfer_syntax == kBigEndian);
  return transfer_syntax == kDeflate ? isomesh::test::raw_deflate(data) : data;
}

std::int64_t DicomSeries::stored(std::uint32_t i, std::uint32_t j, std::uint32_t k) const {
  const std::uint64_t mixed = ((k * 31 + j) * 37 + i + 1) * 0x9E3779B97F4A7C15U;
  const auto bits = is_smooth ? std::int64_t{i + j * 2 + k * 3} << (bits_stored - 7)
                              : static_cast<std::int64_t>(mixed >> (64 - bits_stored));
  return is_signed ? bits - (std::int64_t{1} << (bits_stored - 1)) : bits;
}

Vector3 DicomSeries::position(std::uint32_t slice) const {
  Vector3 result = origin;
  for (std::size_t axis = 0; axis < 3; ++axis) result[axis] += step[axis] * slice;
  return result;
}

std::string DicomSeries::native_bytes(std::uint32_t slice) const {
  std::string bytes;
  const std::uint64_t mask = (std::uint64_t{1} << bits_stored) - 1;
  for (std::uint32_t j = 0; j < rows; ++j) {
    for (std::uint32_t i = 0; i < columns; ++i) {
      const auto bits = static_cast<std::uint64_t>(stored(i, j, slice)) & mask;
      bytes += number(bits << (high_bit + 1 - bits_stored), bits_allocated / 8, false);
    }
  }
  return bytes;
}

DicomObject DicomSeries::slice(std::uint32_t number) const {
  DicomObject object;
  object.text(dicom::kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.2")
      .text(dicom::kSopInstanceUid, "UI", uid + '.' + std::to_string(number + 1))
      .text(dicom::kModality, "CS", "CT")
      .text(dicom::kSeriesInstanceUid, "UI", uid)
      .text(dicom::kInstanceNumber, "IS", std::to_string(number + 1))
      .text(dicom::kImagePosition, "DS", joined(position(number)))
      .text(dicom::kImageOrientation, "DS", joined(along_row, along_column))
      .number(dicom::kSamplesPerPixel, 1)
      .text(dicom::kPhotometricInterpretation, "CS", "MONOCHROME2")
      .number(dicom::kRows, rows)
      .number(dicom::kColumns, columns)
      .text(dicom::kPixelSpacing, "DS", joined({between_rows, between_columns}))
      .number(dicom::kBitsAllocated, bits_allocated)
      .number(dicom::kBitsStored, bits_stored)
      .number(dicom::kHighBit, high_bit)
      .number(dicom::kPixelRepresentation, is_signed ? 1 : 0)
      .pixels(native_bytes(number), bits_allocated / 8);
  return object;
}

DicomObject DicomSeries::enhanced(const std::vector<std::uint32_t>& order) const {
  DicomObject object = slice(0);
  std::vector<DicomObject> frames;
  std::string pixels;
  for (const std::uint32_t number : order) {
    frames.push_back(frame_at(position(number)));
    pixels += native_bytes(number);
  }
  const DicomObject shared =
      shared_groups(joined({between_rows, between_columns}), joined(along_row, along_column));
  return object.erase(dicom::kImagePosition)
      .erase(dicom::kImageOrientation)
      .erase(dicom::kPixelSpacing)
      .text(dicom::kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.2.1")
      .text(dicom::kNumberOfFrames, "IS", std::to_string(order.size()))
      .items(dicom::kSharedFunctionalGroups, {shared})
      .items(dicom::kPerFrameFunctionalGroups, frames)
      .pixels(pixels, bits_allocated / 8);
}

NamedFiles DicomSeries::files() const {
  NamedFiles result;
  for (std::uint32_t k = 0; k < slices; ++k) {
    // Steps without a common divisor, so neither names nor order follow positions.
    const std::uint32_t number = (k * 23 + 3) % slices;
    result.emplace_back("IM" + std::to_string(k + 8), slice(number).file(syntax));
  }
  return result;
}

NamedFiles changed(const DicomSeries& series,
                   const std::function<void(DicomObject&, std::uint32_t)>& change) {
  NamedFiles files;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject object = series.slice(k);
    change(object, k);
    files.emplace_back("IM" + std::to_string(k + 1), object.file(series.syntax));
  }
  return files;
}

NamedFiles changed(const DicomSeries& series, const std::function<void(DicomObject&)>& change) {
  return changed(series, [&](DicomObject& object, std::uint32_t) { change(object); });
}

DicomObject frame_at(const Vector3& position) {
  return DicomObject().items(dicom::kPlanePositionSequence,
                             {DicomObject().text(dicom::kImagePosition, "DS", joined(position))});
}

DicomObject shared_groups(const std::string& spacing, const std::string& orientation) {
  return DicomObject()
      .items(dicom::kPlaneOrientationSequence,
             {DicomObject().text(dicom::kImageOrientation, "DS", orientation)})
      .items(dicom::kPixelMeasuresSequence,
             {DicomObject().text(dicom::kPixelSpacing, "DS", spacing)});
}

std::string compressed(std::string_view transfer_syntax, const dicom::PixelLayout& layout,
                       const std::string& native) {
  const auto bits = [](unsigned count) { return static_cast<unsigned short>(count); };
  gdcm::DataElement pixels(gdcm::Tag(0x7fe0, 0x0010));
  pixels.SetByteValue(native.data(), static_cast<std::uint32_t>(native.size()));
  // On the heap, because GDCM counts its references.
  const gdcm::SmartPointer<gdcm::Image> image = new gdcm::Image;
  image->SetNumberOfDimensions(2);
  image->SetDimension(0, layout.columns);
  image->SetDimension(1, layout.rows);
  image->SetPixelFormat(gdcm::PixelFormat(1, bits(layout.bits_allocated), bits(layout.bits_stored),
                                          bits(layout.high_bit), layout.is_signed ? 1 : 0));
  image->SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  image->SetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
  image->SetDataElement(pixels);
  gdcm::ImageChangeTransferSyntax change;
  change.SetTransferSyntax(gdcm::TransferSyntax::GetTSType(std::string(transfer_syntax).c_str()));
  change.SetInput(*image);
  if (!change.Change()) throw std::logic_error("GDCM cannot encode");
  const gdcm::DataElement& encoded = change.GetOutput().GetDataElement();
  const gdcm::ByteValue* bytes = encoded.GetSequenceOfFragments()->GetFragment(0).GetByteValue();
  std::string result(bytes->GetPointer(), bytes->GetLength());
  if (result.size() % 2 != 0) result += '\0';
  return result;
}

Outcome import_objects(const NamedFiles& files, const ImportOptions& options,
                       const SizeLimits& limits) {
  const Folder sources;
  const Folder target;
  std::vector<NamedFile> paths;
  for (const auto& [name, bytes] : files) paths.push_back(named(sources.write(name, bytes)));
  const Outcome outcome = outcome_of(target.path("target"), [&](const auto& path) {
    return import_dicom(paths, {.source = {},
                                .scratch = target.path(""),
                                .target = path,
                                .options = options,
                                .limits = limits});
  });
  std::filesystem::remove(target.path("target"));
  if (target.entries() != 0) throw std::logic_error("an import left files behind");
  return outcome;
}

std::string note_detail(const Outcome& outcome, NoteCode code) {
  const auto& notes = outcome.volume.notes;
  const auto found = std::ranges::find(notes, describe(code).name, &Note::code);
  return found == notes.end() ? "" : found->detail;
}

}  // namespace isomesh::import::test
