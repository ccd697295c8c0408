#include <algorithm>
#include <charconv>
#include <exception>
#include <limits>
#include <memory>
#include <string>
#include <system_error>

#include <expat.h>

#include "proto/error.h"
#include "server/codec/decode/formats.h"
#include "server/codec/decode/zip_reader.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::string_view kModelName = "3D/3dmodel.model";

[[noreturn]] void refuse_3mf(const std::string& why) { refuse(MeshFormat::k3mf, why); }

// The attributes of an element, as expat has them: names and values by turns, up to a null.
using Attributes = const XML_Char**;

std::string_view value_of(Attributes attributes, std::string_view name) {
  for (; attributes[0] != nullptr; attributes += 2) {
    if (attributes[0] == name) return attributes[1];
  }
  refuse_3mf("an element has no attribute \"" + std::string(name) + "\"");
}

template <class T>
T number_of(Attributes attributes, std::string_view name) {
  const std::string_view text = value_of(attributes, name);
  T number = {};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) {
    refuse_3mf("\"" + std::string(text) + "\" is not the number that \"" + std::string(name) +
               "\" has to be");
  }
  return number;
}

bool has(Attributes attributes, std::string_view name) {
  for (; attributes[0] != nullptr; attributes += 2) {
    if (attributes[0] == name) return true;
  }
  return false;
}

// The one model of a package. Objects are those that are built, each once; that is looked at in the
// end. Exceptions cannot pass through the C library, so they are kept until parsing has stopped.
class Model {
 public:
  Model() : parser_(::XML_ParserCreate("UTF-8")) {
    if (!parser_) refuse_3mf("expat has no memory");
    ::XML_SetUserData(parser_.get(), this);
    ::XML_SetStartElementHandler(parser_.get(), &Model::on_start);
    ::XML_SetStartDoctypeDeclHandler(parser_.get(), &Model::on_doctype);
  }

  void parse(Bytes piece, bool is_last) {
    constexpr std::size_t kMostBytes = std::size_t{1} << 20;
    do {
      const Bytes next = piece.first(std::min(piece.size(), kMostBytes));
      piece = piece.subspan(next.size());
      const auto status =
          ::XML_Parse(parser_.get(), reinterpret_cast<const char*>(next.data()),
                      static_cast<int>(next.size()), is_last && piece.empty() ? 1 : 0);
      if (failure_) std::rethrow_exception(failure_);
      if (status == XML_STATUS_OK) continue;
      const char* reason = ::XML_ErrorString(::XML_GetErrorCode(parser_.get()));
      refuse_3mf("its model is no well-formed XML: " +
                 std::string(reason == nullptr ? "unknown" : reason) + " in line " +
                 std::to_string(::XML_GetCurrentLineNumber(parser_.get())));
    } while (!piece.empty());
  }

  DecodedSurface surface() const {
    if (!is_model_) refuse_3mf("its model is not in millimetres");
    if (objects_ != built_) refuse_3mf("an object is not built, or not alone");
    DecodedSurface surface;
    surface.positions.resize_for_overwrite(positions_.size());
    std::ranges::copy(positions_, surface.positions.begin());
    surface.triangles.resize_for_overwrite(triangles_.size());
    std::ranges::copy(triangles_, surface.triangles.begin());
    return surface;
  }

 private:
  struct Free {
    void operator()(XML_Parser parser) const { ::XML_ParserFree(parser); }
  };

  template <class Action>
  void guarded(const Action& action) {
    if (failure_) return;
    try {
      action();
    } catch (...) {
      failure_ = std::current_exception();
      ::XML_StopParser(parser_.get(), XML_FALSE);
    }
  }

  static void XMLCALL on_start(void* self, const XML_Char* name, Attributes attributes) {
    auto& model = *static_cast<Model*>(self);
    model.guarded([&] { model.start(name, attributes); });
  }
  static void XMLCALL on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*,
                                 int) {
    auto& model = *static_cast<Model*>(self);
    model.guarded([] { refuse_3mf("it has a document type, which the format forbids"); });
  }

  void start(std::string_view element, Attributes attributes) {
    if (element == "vertex") {
      if (positions_.size() == std::numeric_limits<std::uint32_t>::max()) {
        throw Error(ErrorCode::kTooLarge, "the file has more vertices than 32 bits can number");
      }
      positions_.push_back({number_of<float>(attributes, "x"), number_of<float>(attributes, "y"),
                            number_of<float>(attributes, "z")});
    } else if (element == "triangle") {
      triangles_.push_back(
          {vertex_of(attributes, "v1"), vertex_of(attributes, "v2"), vertex_of(attributes, "v3")});
    } else if (element == "object") {
      objects_.push_back(number_of<std::uint32_t>(attributes, "id"));
      first_vertex_ = static_cast<std::uint32_t>(positions_.size());
    } else if (element == "item") {
      built_.push_back(number_of<std::uint32_t>(attributes, "objectid"));
      if (has(attributes, "transform")) refuse_3mf("an object is built elsewhere than it lies");
    } else if (element == "model") {
      is_model_ = value_of(attributes, "unit") == "millimeter";
    } else if (element == "components") {
      refuse_3mf("an object is made of others");
    }
  }

  // Of the object's own, which all come before its triangles.
  std::uint32_t vertex_of(Attributes attributes, std::string_view name) const {
    const auto vertex = number_of<std::uint32_t>(attributes, name);
    if (vertex >= positions_.size() - first_vertex_) {
      refuse_3mf("a triangle names a vertex that is not there");
    }
    return first_vertex_ + vertex;
  }

  const std::unique_ptr<std::remove_pointer_t<XML_Parser>, Free> parser_;
  std::exception_ptr failure_;
  bool is_model_ = false;
  std::uint32_t first_vertex_ = 0;
  std::vector<mesh::Vec3> positions_;
  std::vector<mesh::Triangle> triangles_;
  std::vector<std::uint32_t> objects_;
  std::vector<std::uint32_t> built_;
};

}  // namespace

DecodedSurface decode_3mf(Bytes file, const mesh::Context& context) {
  ZipReader reader(file, MeshFormat::k3mf);
  while (const auto name = reader.next()) {
    if (*name != kModelName) continue;
    Model model;
    reader.read([&](Bytes piece) {
      context.throw_if_stopped();
      model.parse(piece, false);
    });
    model.parse({}, true);
    return model.surface();
  }
  refuse_3mf("it has no model");
}

}  // namespace isomesh::codec::decoding
