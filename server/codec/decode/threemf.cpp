#include <algorithm>
#include <charconv>
#include <limits>
#include <string>
#include <system_error>

#include "base/xml_reader.h"
#include "proto/error.h"
#include "server/codec/decode/formats.h"
#include "server/codec/decode/zip_reader.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::string_view kModelName = "3D/3dmodel.model";

[[noreturn]] void refuse_3mf(const std::string& why) { refuse(MeshFormat::k3mf, why); }

std::string_view value_of(const XmlAttributes& attributes, std::string_view name) {
  const auto value = attributes.find(name);
  if (!value) refuse_3mf("an element has no attribute \"" + std::string(name) + "\"");
  return *value;
}

template <class T>
T number_of(const XmlAttributes& attributes, std::string_view name) {
  const std::string_view text = value_of(attributes, name);
  T number = {};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) {
    refuse_3mf("\"" + std::string(text) + "\" is not a number, as \"" + std::string(name) +
               "\" must be");
  }
  return number;
}

// The one model of a package. Objects are those that are built, each once; that is looked at in the
// end.
class Model : public XmlHandler {
 public:
  void parse(Bytes piece, bool is_last) {
    try {
      reader_.read({reinterpret_cast<const char*>(piece.data()), piece.size()}, is_last);
    } catch (const XmlError& error) {
      refuse_3mf("its model is not valid XML: " + std::string(error.what()));
    }
  }

  DecodedSurface surface() const {
    if (!is_model_) refuse_3mf("its model is not in millimetres");
    if (objects_ != built_) refuse_3mf("an object is not built, or is built more than once");
    DecodedSurface surface;
    surface.positions.resize_for_overwrite(positions_.size());
    std::ranges::copy(positions_, surface.positions.begin());
    surface.triangles.resize_for_overwrite(triangles_.size());
    std::ranges::copy(triangles_, surface.triangles.begin());
    return surface;
  }

 private:
  void start_element(std::string_view element, const XmlAttributes& attributes) override {
    if (element == "vertex") {
      if (positions_.size() == std::numeric_limits<std::uint32_t>::max()) {
        throw Error(ErrorCode::kTooLarge, "The file has more vertices than 32 bits can number.");
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
      if (attributes.find("transform")) refuse_3mf("an object is transformed");
    } else if (element == "model") {
      is_model_ = value_of(attributes, "unit") == "millimeter";
    } else if (element == "components") {
      refuse_3mf("an object consists of other objects");
    }
  }

  // Of the object's own, which all come before its triangles.
  std::uint32_t vertex_of(const XmlAttributes& attributes, std::string_view name) const {
    const auto vertex = number_of<std::uint32_t>(attributes, name);
    if (vertex >= positions_.size() - first_vertex_) {
      refuse_3mf("a triangle names a vertex that does not exist");
    }
    return first_vertex_ + vertex;
  }

  XmlReader reader_{*this};
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
