#include "server/import/formats/vti_document.h"

#include <algorithm>

#include "base/text.h"
#include "base/xml_reader.h"
#include "proto/error.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

// Parses a document incrementally up to its appended data, which is not XML.
class VtiParser : public XmlHandler {
 public:
  enum class Until { kImage, kSamples };

  VtiParser(const InputFile& file, Until until) : file_(file), until_(until) {}

  VtiDocument parse() {
    constexpr std::size_t kXmlPieceBytes = std::size_t{1} << 16;
    for (std::uint64_t next = 0; !reader_.is_stopped();) {
      const std::string piece = file_.text(next, kXmlPieceBytes);
      next += piece.size();
      const bool last = next >= file_.size();
      try {
        reader_.read(piece, last);
      } catch (const XmlError& error) {
        throw_unusable("The VTK file is not valid XML: " + std::string(error.what()) + ".");
      }
      if (last) break;
      check_progress(next);
    }
    return std::move(document_);
  }

 private:
  // expat rescans an unfinished tag or comment with each piece, so their length is bounded.
  void check_progress(std::uint64_t read) const {
    constexpr std::uint64_t kLongest = std::uint64_t{1} << 20;
    if (read > kLongest && reader_.begin() < read - kLongest) {
      throw_unusable("The VTK file has a tag or a comment of more than " +
                     std::to_string(kLongest) + " bytes.");
    }
  }

  void encoding(std::string_view encoding) override {
    // Other encodings do not allow reading the samples' text byte by byte.
    const std::string name = lower(encoding);
    if (name == "utf-8" || name == "us-ascii" || name == "iso-8859-1") return;
    throw_unusable("The VTK file's encoding " + in_quotes(name) + " is not supported.");
  }

  void start_element(std::string_view name, const XmlAttributes& pairs) override {
    constexpr std::size_t kDeepest = 32;
    constexpr std::size_t kMostElements = 100'000;
    // Longer than any name that is looked for. Each element costs a copy of the names around it.
    constexpr std::size_t kLongestName = 64;
    if (path_.size() >= kDeepest) throw_unusable("The VTK file's elements are nested too deeply.");
    if (++elements_ > kMostElements) {
      throw_unusable("The VTK file has more than the " + std::to_string(kMostElements) +
                     " elements that are supported.");
    }
    path_.emplace_back(name.substr(0, kLongestName));
    HeaderTexts attributes;
    pairs.for_each([&](const char* key, const char* value) { attributes.emplace(key, value); });
    const std::string place = joined_path();
    if (place == "VTKFile") {
      document_.file = std::move(attributes);
      check_kind();
    } else if (place == "VTKFile/ImageData") {
      document_.image = std::move(attributes);
      if (until_ == Until::kImage) reader_.stop();
    } else if (place == "VTKFile/ImageData/Piece") {
      document_.piece = std::move(attributes);
      ++document_.pieces;
    } else if (place == "VTKFile/ImageData/Piece/PointData") {
      document_.point_data = std::move(attributes);
    } else if (place == "VTKFile/ImageData/Piece/CellData") {
      document_.cell_data = std::move(attributes);
    } else if (auto* arrays = arrays_at(place)) {
      add_array(std::move(attributes), *arrays);
    } else if (place == "VTKFile/AppendedData") {
      document_.appended = std::move(attributes);
      document_.appended_at = reader_.end();
      reader_.stop();
    }
  }

  void end_element(std::string_view) override {
    if (auto* arrays = arrays_at(joined_path())) {
      CompressedRange& text = arrays->back().text;
      text.bytes = reader_.begin() - std::min(reader_.begin(), text.offset);
    }
    path_.pop_back();
  }

  void check_kind() const {
    const std::string_view type = value_of(document_.file, "type");
    if (type == "ImageData") return;
    throw_unusable("The VTK file holds " + in_quotes(type) + ", not ImageData.");
  }

  // The list that an array at this place belongs to; null for no array.
  std::vector<VtiArray>* arrays_at(std::string_view place) {
    if (place == "VTKFile/ImageData/Piece/PointData/DataArray") return &document_.point_arrays;
    if (place == "VTKFile/ImageData/Piece/CellData/DataArray") return &document_.cell_arrays;
    return nullptr;
  }

  void add_array(HeaderTexts attributes, std::vector<VtiArray>& arrays) const {
    constexpr std::size_t kMostArrays = 1000;
    if (arrays.size() == kMostArrays) {
      throw_unusable("The VTK file has more than the 1000 arrays that are supported.");
    }
    arrays.push_back({std::move(attributes), {reader_.end(), 0}});
  }

  std::string joined_path() const {
    std::string path;
    for (const std::string& name : path_) path += (path.empty() ? "" : "/") + name;
    return path;
  }

  const InputFile& file_;
  const Until until_;
  VtiDocument document_;
  std::vector<std::string> path_;
  std::size_t elements_ = 0;
  XmlReader reader_{*this};
};

}  // namespace

VtiDocument read_vti_document(const InputFile& file) {
  return VtiParser(file, VtiParser::Until::kSamples).parse();
}

HeaderTexts read_vti_image(const InputFile& beginning) {
  HeaderTexts image = VtiParser(beginning, VtiParser::Until::kImage).parse().image;
  if (image.empty()) throw_unusable("The VTK file does not begin with the extent of an image.");
  return image;
}

}  // namespace isomesh::import
