#include "server/import/formats/vti_document.h"

#include <algorithm>
#include <exception>
#include <memory>

#include <expat.h>

#include "base/text.h"
#include "proto/error.h"
#include "server/import/names.h"

namespace isomesh::import {
namespace {

// Reads a document piece by piece, up to its appended data, which is no XML. Exceptions cannot pass
// through the C library, so they are kept until parsing has stopped.
class Parser {
 public:
  enum class Until { kImage, kSamples };

  Parser(const InputFile& file, Until until)
      : file_(file), until_(until), parser_(::XML_ParserCreate(nullptr)) {
    if (!parser_) throw Error(ErrorCode::kInternal, "XML_ParserCreate failed.");
    ::XML_SetUserData(parser_.get(), this);
    ::XML_SetElementHandler(parser_.get(), &Parser::on_start, &Parser::on_end);
    ::XML_SetXmlDeclHandler(parser_.get(), &Parser::on_declaration);
    ::XML_SetStartDoctypeDeclHandler(parser_.get(), &Parser::on_doctype);
  }

  VtiDocument parse() {
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
    VtiAttributes attributes;
    for (; pairs[0] != nullptr; pairs += 2) attributes.emplace(pairs[0], pairs[1]);
    const std::string place = joined_path();
    if (place == "VTKFile") {
      document_.file = std::move(attributes);
      check_kind();
    } else if (place == "VTKFile/ImageData") {
      document_.image = std::move(attributes);
      if (until_ == Until::kImage) stop();
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
      stop();
    }
  }

  void stop() {
    done_ = true;
    ::XML_StopParser(parser_.get(), XML_FALSE);
  }

  void end() {
    if (joined_path() == kArrayPlace) {
      CompressedRange& text = document_.arrays.back().text;
      text.bytes = position() - std::min(position(), text.offset);
    }
    path_.pop_back();
  }

  void check_kind() const {
    const std::string_view type = attribute_of(document_.file, "type");
    if (type == "ImageData") return;
    throw_unusable("The VTK file holds " + in_quotes(type) + ", not ImageData.");
  }

  void add_array(VtiAttributes attributes) {
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
  const Until until_;
  std::unique_ptr<std::remove_pointer_t<XML_Parser>, Free> parser_;
  VtiDocument document_;
  std::vector<std::string> path_;
  std::exception_ptr failure_;
  bool done_ = false;
};

}  // namespace

std::string_view attribute_of(const VtiAttributes& attributes, std::string_view name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? std::string_view{} : std::string_view(found->second);
}

VtiDocument read_vti_document(const InputFile& file) {
  return Parser(file, Parser::Until::kSamples).parse();
}

VtiAttributes read_vti_image(const InputFile& beginning) {
  VtiAttributes image = Parser(beginning, Parser::Until::kImage).parse().image;
  if (image.empty()) throw_unusable("The VTK file does not begin with an image's extent.");
  return image;
}

}  // namespace isomesh::import
