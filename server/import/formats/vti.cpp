#include "server/import/formats/vti.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <expat.h>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::import {
namespace {

using Attributes = std::map<std::string, std::string, std::less<>>;

// An array of the point data.
struct Array {
  Attributes attributes;
  CompressedRange text;  // the file's bytes between its tags
};

// The parts of the XML that a volume needs.
struct Document {
  Attributes file;
  Attributes image;
  Attributes piece;
  Attributes point_data;
  std::size_t pieces = 0;
  std::vector<Array> arrays;
  Attributes appended;
  std::uint64_t appended_at = 0;  // where its data begins in the file; 0: there is none
};

std::string_view value_of(const Attributes& attributes, std::string_view name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? std::string_view{} : std::string_view(found->second);
}

// --- XML -----------------------------------------------------------------------------------------

// Reads a document piece by piece, up to its appended data, which is no XML. Exceptions cannot pass
// through the C library, so they are kept until parsing has stopped.
class Parser {
 public:
  explicit Parser(const InputFile& file) : file_(file), parser_(::XML_ParserCreate(nullptr)) {
    if (!parser_) throw Error(ErrorCode::kInternal, "XML_ParserCreate failed.");
    ::XML_SetUserData(parser_.get(), this);
    ::XML_SetElementHandler(parser_.get(), &Parser::on_start, &Parser::on_end);
    ::XML_SetXmlDeclHandler(parser_.get(), &Parser::on_declaration);
    ::XML_SetStartDoctypeDeclHandler(parser_.get(), &Parser::on_doctype);
  }

  Document parse() {
    constexpr std::size_t kPieceBytes = std::size_t{1} << 16;
    for (std::uint64_t next = 0; !done_;) {
      const std::string piece = file_.text(next, kPieceBytes);
      next += piece.size();
      const bool last = next >= file_.size();
      const auto status = ::XML_Parse(parser_.get(), piece.data(), static_cast<int>(piece.size()),
                                      last ? XML_TRUE : XML_FALSE);
      if (failure_) std::rethrow_exception(failure_);
      if (done_ || (status == XML_STATUS_OK && last)) break;
      if (status != XML_STATUS_OK) throw_malformed();
      check_progress(next);
    }
    return std::move(document_);
  }

 private:
  struct Free {
    void operator()(XML_Parser parser) const { ::XML_ParserFree(parser); }
  };

  // The library looks at a tag or comment from its beginning again for each piece of it.
  void check_progress(std::uint64_t read) const {
    constexpr std::uint64_t kLongest = std::uint64_t{1} << 20;
    if (read > kLongest && position() < read - kLongest) {
      throw_unusable("The VTK file has a tag or a comment of more than " +
                     std::to_string(kLongest) + " bytes.");
    }
  }

  [[noreturn]] void throw_malformed() const {
    const char* reason = ::XML_ErrorString(::XML_GetErrorCode(parser_.get()));
    throw_unusable("The VTK file is no well-formed XML: " +
                   std::string(reason == nullptr ? "unknown" : reason) + " in line " +
                   std::to_string(::XML_GetCurrentLineNumber(parser_.get())) + ".");
  }

  template <class Action>
  void guarded(const Action& action) {
    if (failure_ || done_) return;
    try {
      action();
    } catch (...) {
      failure_ = std::current_exception();
      ::XML_StopParser(parser_.get(), XML_FALSE);
    }
  }

  static void XMLCALL on_start(void* self, const XML_Char* name, const XML_Char** attributes) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] { parser.start(name, attributes); });
  }
  static void XMLCALL on_end(void* self, const XML_Char*) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] { parser.end(); });
  }
  static void XMLCALL on_declaration(void* self, const XML_Char*, const XML_Char* encoding, int) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] {
      // In other encodings the samples' text could not be read byte by byte.
      const std::string name = lower(encoding == nullptr ? "utf-8" : encoding);
      if (name == "utf-8" || name == "us-ascii" || name == "iso-8859-1") return;
      throw_unusable("The VTK file's encoding " + in_quotes(name) + " is not read.");
    });
  }
  // A few lines of nested entities expand to gigabytes, so none is accepted; VTK writes none.
  static void XMLCALL on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*,
                                 int) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded(
        [] { throw_unusable("The VTK file has a document type, which VTK's have not."); });
  }

  std::uint64_t position() const {
    return static_cast<std::uint64_t>(
        std::max(::XML_GetCurrentByteIndex(parser_.get()), XML_Index{0}));
  }
  std::uint64_t behind_tag() const {
    return position() + static_cast<std::uint64_t>(::XML_GetCurrentByteCount(parser_.get()));
  }

  void start(const XML_Char* name, const XML_Char** pairs) {
    constexpr std::size_t kDeepest = 32;
    if (path_.size() >= kDeepest) throw_unusable("The VTK file's elements are nested too deeply.");
    path_.emplace_back(name);
    Attributes attributes;
    for (; pairs[0] != nullptr; pairs += 2) attributes.emplace(pairs[0], pairs[1]);
    const std::string place = joined_path();
    if (place == "VTKFile") {
      document_.file = std::move(attributes);
      check_kind();
    } else if (place == "VTKFile/ImageData") {
      document_.image = std::move(attributes);
    } else if (place == "VTKFile/ImageData/Piece") {
      document_.piece = std::move(attributes);
      ++document_.pieces;
    } else if (place == "VTKFile/ImageData/Piece/PointData") {
      document_.point_data = std::move(attributes);
    } else if (place == kArrayPlace) {
      add_array(std::move(attributes));
    } else if (place == "VTKFile/AppendedData") {
      document_.appended = std::move(attributes);
      document_.appended_at = behind_tag();
      done_ = true;
      ::XML_StopParser(parser_.get(), XML_FALSE);
    }
  }

  void end() {
    if (joined_path() == kArrayPlace) {
      CompressedRange& text = document_.arrays.back().text;
      text.bytes = position() - std::min(position(), text.offset);
    }
    path_.pop_back();
  }

  void check_kind() const {
    const std::string_view type = value_of(document_.file, "type");
    if (type == "ImageData") return;
    throw_unusable("The VTK file holds " + in_quotes(type) + ", not ImageData.");
  }

  void add_array(Attributes attributes) {
    constexpr std::size_t kMostArrays = 1000;
    if (document_.arrays.size() == kMostArrays) {
      throw_unusable("The VTK file has more than a thousand arrays.");
    }
    document_.arrays.push_back({std::move(attributes), {behind_tag(), 0}});
  }

  std::string joined_path() const {
    std::string path;
    for (const std::string& name : path_) path += (path.empty() ? "" : "/") + name;
    return path;
  }

  static constexpr std::string_view kArrayPlace = "VTKFile/ImageData/Piece/PointData/DataArray";

  const InputFile& file_;
  std::unique_ptr<std::remove_pointer_t<XML_Parser>, Free> parser_;
  Document document_;
  std::vector<std::string> path_;
  std::exception_ptr failure_;
  bool done_ = false;
};

// --- The volume ----------------------------------------------------------------------------------

template <std::size_t Count>
std::array<double, Count> numbers_of(const Attributes& attributes, std::string_view name,
                                     const std::array<double, Count>& otherwise) {
  const std::string_view text = value_of(attributes, name);
  if (text.empty()) return otherwise;
  const auto parts = words(text);
  std::array<double, Count> numbers = {};
  bool valid = parts.size() == Count;
  for (std::size_t at = 0; valid && at < Count; ++at) {
    const auto number = parse_double(parts[at]);
    valid = number && std::isfinite(*number);
    numbers[at] = number.value_or(0);
  }
  if (valid) return numbers;
  throw_unusable("The VTK file's " + in_quotes(name) + " is not " + std::to_string(Count) +
                 " finite numbers.");
}

struct Extent {
  std::array<std::int64_t, 3> first = {0, 0, 0};
  std::array<std::uint32_t, 3> dims = {0, 0, 0};

  bool operator==(const Extent&) const = default;
};

Extent extent_of(const Attributes& attributes, std::string_view name) {
  const auto parts = words(value_of(attributes, name));
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int32_t>::max();
  Extent extent;
  std::array<std::uint64_t, 3> sizes = {0, 0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto first = parts.size() == 6 ? parse_int64(parts[axis * 2]) : std::nullopt;
    const auto last = parts.size() == 6 ? parse_int64(parts[axis * 2 + 1]) : std::nullopt;
    if (!first || !last || std::abs(*first) > kFarthest || std::abs(*last) > kFarthest ||
        *last < *first) {
      throw_unusable("The VTK file's " + in_quotes(name) +
                     " is not the first and last index along each of three axes.");
    }
    extent.first[axis] = *first;
    sizes[axis] = static_cast<std::uint64_t>(*last - *first + 1);
  }
  extent.dims = volume_dims(sizes);
  return extent;
}

Geometry geometry_of(const Attributes& image, const Extent& extent) {
  Geometry geometry;
  geometry.spacing = numbers_of<3>(image, "Spacing", {1, 1, 1});
  geometry.direction = numbers_of<9>(image, "Direction", geometry.direction);
  geometry.origin = numbers_of<3>(image, "Origin", {0, 0, 0});
  // The file's origin is the place of the index (0,0,0), which the extent may leave out.
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 step = step_of(geometry, axis);
    const auto count = static_cast<double>(extent.first[static_cast<std::size_t>(axis)]);
    for (std::size_t row = 0; row < 3; ++row) geometry.origin[row] += step[row] * count;
  }
  return geometry;
}

StoredType type_of(const Array& array) {
  struct Row {
    std::string_view name;
    StoredType type;
  };
  static constexpr Row kTypes[] = {
      {"Int8", StoredType::kInt8},       {"UInt8", StoredType::kUint8},
      {"Int16", StoredType::kInt16},     {"UInt16", StoredType::kUint16},
      {"Int32", StoredType::kInt32},     {"UInt32", StoredType::kUint32},
      {"Int64", StoredType::kInt64},     {"UInt64", StoredType::kUint64},
      {"Float32", StoredType::kFloat32}, {"Float64", StoredType::kFloat64},
  };
  const std::string_view name = value_of(array.attributes, "type");
  for (const Row& row : kTypes) {
    if (row.name == name) return row.type;
  }
  throw_unusable("The VTK array's type " + in_quotes(name) + " is not one of plain numbers.");
}

// The image's samples: the array that the point data names as its scalars, or the only one.
const Array& scalars_of(const Document& document) {
  const std::string_view scalars = value_of(document.point_data, "Scalars");
  const Array* found = nullptr;
  for (const Array& array : document.arrays) {
    if (!scalars.empty() && value_of(array.attributes, "Name") != scalars) continue;
    if (found != nullptr) {
      throw_unusable("The VTK file has several arrays of point data, and none is its scalars.");
    }
    found = &array;
  }
  if (found != nullptr) return *found;
  throw_unusable(scalars.empty()
                     ? "The VTK file has no point data, which is where samples are."
                     : "The VTK file has no array " + in_quotes(scalars) + ", its scalars.");
}

void check_components(const Array& array) {
  const std::string_view count = value_of(array.attributes, "NumberOfComponents");
  if (count.empty() || parse_uint64(count) == 1) return;
  throw_unusable("Each sample has " + in_quotes(count) +
                 " components, where plain numbers are needed.");
}

bool is_big_endian(const Document& document) {
  const std::string_view order = value_of(document.file, "byte_order");
  if (order == "LittleEndian") return false;
  if (order == "BigEndian") return true;
  throw_unusable("The VTK file's byte_order " + in_quotes(order) + " is unknown.");
}

bool has_wide_header(const Document& document) {
  const std::string_view type = value_of(document.file, "header_type");
  if (type.empty() || type == "UInt32") return false;
  if (type == "UInt64") return true;
  throw_unusable("The VTK file's header_type " + in_quotes(type) + " is unknown.");
}

VtkCompression compression_of(const Document& document) {
  const std::string_view compressor = value_of(document.file, "compressor");
  if (compressor.empty()) return VtkCompression::kNone;
  if (compressor == "vtkZLibDataCompressor") return VtkCompression::kZlib;
  if (compressor == "vtkLZ4DataCompressor") return VtkCompression::kLz4;
  if (compressor == "vtkLZMADataCompressor") return VtkCompression::kXz;
  throw_unusable("The VTK file's compressor " + in_quotes(compressor) + " is unknown.");
}

// Throws where an entity or a comment stands among the samples, because the decoder would read it
// as samples.
void check_text(const InputFile& file, const CompressedRange& text) {
  constexpr std::size_t kPieceBytes = std::size_t{1} << 18;
  for (std::uint64_t done = 0; done < text.bytes;) {
    const std::string piece =
        file.text(text.offset + done, std::min<std::uint64_t>(kPieceBytes, text.bytes - done));
    if (piece.empty() || piece.find_first_of("<&") != std::string::npos) {
      throw_unusable("The VTK array that holds the samples has something else among them.");
    }
    done += piece.size();
  }
}

// Appended data is no XML, so the parser does not notice when the end of the file is missing.
void check_end(const InputFile& file) {
  constexpr std::uint64_t kTailBytes = 256;
  const std::string tail = file.text(file.size() - std::min(kTailBytes, file.size()), kTailBytes);
  if (trimmed(tail).ends_with("</VTKFile>")) return;
  throw_unusable("The file is truncated: it does not end as VTK files do.");
}

CompressedRange appended_range(const InputFile& file, const Document& document,
                               const Array& array) {
  constexpr std::size_t kMostSpace = 4096;
  const auto offset = parse_uint64(value_of(array.attributes, "offset"));
  const std::string start = file.text(document.appended_at, kMostSpace);
  const std::size_t mark = start.find_first_not_of(" \t\r\n");
  if (!offset || document.appended_at == 0 || mark == std::string::npos || start[mark] != '_') {
    throw_unusable("The VTK file's appended data is not where it should begin.");
  }
  const std::uint64_t begin = document.appended_at + mark + 1;
  if (*offset > file.size() - begin) {
    throw_unusable("The file is truncated: it ends before the VTK array that holds the samples.");
  }
  return {begin + *offset, file.size() - begin - *offset};
}

bool appended_is_base64(const Document& document) {
  const std::string_view encoding = value_of(document.appended, "encoding");
  if (encoding == "base64") return true;
  if (encoding == "raw") return false;
  throw_unusable("The VTK file's appended data has the encoding " + in_quotes(encoding) +
                 "; raw and base64 are read.");
}

void place_samples(const InputFile& file, const Document& document, const Array& array,
                   SourceVolume& volume) {
  const std::string_view format = value_of(array.attributes, "format");
  volume.payload = array.text;
  if (format == "ascii") {
    volume.encoding = Encoding::kText;
    return check_text(file, array.text);
  }
  volume.encoding = Encoding::kVtk;
  volume.layout.big_endian = is_big_endian(document);
  volume.vtk = {.base64 = true,
                .compression = compression_of(document),
                .wide_header = has_wide_header(document),
                .big_endian = volume.layout.big_endian};
  if (format == "binary") return check_text(file, array.text);
  if (format != "appended") {
    throw_unusable("The VTK array's format " + in_quotes(format) + " is unknown.");
  }
  check_end(file);
  volume.payload = appended_range(file, document, array);
  volume.vtk.base64 = appended_is_base64(document);
}

}  // namespace

bool is_vti(std::string_view head) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (head.starts_with(kByteOrderMark)) head.remove_prefix(kByteOrderMark.size());
  return trimmed(head).starts_with('<') && head.find("<VTKFile") != std::string_view::npos;
}

SourceVolume parse_vti(const InputFile& file, const Companions& /*companions*/,
                       const ImportOptions& options) {
  const Document document = Parser(file).parse();
  if (document.pieces != 1) {
    throw_unusable("The VTK file has " + std::to_string(document.pieces) +
                   " pieces, where one is needed.");
  }
  if (!value_of(document.image, "TimeValues").empty()) {
    throw_unusable("The VTK file holds a time series, where one volume is needed.");
  }
  const Extent extent = extent_of(document.image, "WholeExtent");
  if (extent_of(document.piece, "Extent") != extent) {
    throw_unusable("The VTK file's piece does not fill its whole extent.");
  }
  const Array& array = scalars_of(document);
  check_components(array);
  SourceVolume volume;
  volume.dims = extent.dims;
  choose_volume(1, {}, options, volume);
  volume.layout.type = type_of(array);
  place_samples(file, document, array, volume);
  volume.geometry = geometry_of(document.image, extent);
  return volume;
}

}  // namespace isomesh::import
