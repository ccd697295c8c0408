#include "tests/unit/codec/usd_reader.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <initializer_list>
#include <map>
#include <stdexcept>
#include <string_view>

namespace isomesh::test {
namespace {

// The text as tokens: punctuation, strings without their quotes, and words.
class Tokens {
 public:
  explicit Tokens(const std::string& text) : rest_(text) {}

  std::string take() {
    skip_blanks();
    if (rest_.empty()) throw std::runtime_error("the stage ends early");
    if (rest_[0] == '"') return take_string();
    constexpr std::string_view kSingle = "()[]{}=,";
    const std::size_t length = kSingle.find(rest_[0]) != std::string_view::npos
                                   ? 1
                                   : std::min(rest_.find_first_of(" \n()[]{}=,\""), rest_.size());
    // The brackets of a type, such as int[], belong to it.
    const bool is_array = rest_.substr(length).starts_with("[]");
    std::string token(rest_.substr(0, length + (is_array ? 2 : 0)));
    rest_.remove_prefix(token.size());
    return token;
  }

  bool next_is(std::string_view token) {
    skip_blanks();
    return rest_.starts_with(token);
  }

  void expect(std::string_view token) {
    const std::string found = take();
    if (found != token) throw std::runtime_error(found + " instead of " + std::string(token));
  }

  bool is_over() {
    skip_blanks();
    return rest_.empty();
  }

  template <class Number>
  Number number() {
    const std::string token = take();
    Number value = 0;
    const auto [end, code] = std::from_chars(token.data(), token.data() + token.size(), value);
    if (code != std::errc() || end != token.data() + token.size()) {
      throw std::runtime_error(token + " is not a number");
    }
    return value;
  }

  mesh::Vec3 vector() {
    mesh::Vec3 result;
    expect("(");
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (axis > 0) expect(",");
      result[axis] = number<float>();
    }
    expect(")");
    return result;
  }

  template <class One>
  auto array(One one) {
    std::vector<decltype(one())> all;
    for (expect("["); !next_is("]");) {
      if (!all.empty()) expect(",");
      all.push_back(one());
    }
    expect("]");
    return all;
  }

 private:
  void skip_blanks() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \n"), rest_.size()));
  }

  std::string take_string() {
    std::string text;
    std::size_t at = 1;
    for (; at < rest_.size() && rest_[at] != '"'; ++at) {
      if (rest_[at] == '\\') ++at;
      text += rest_.at(at);
    }
    rest_.remove_prefix(std::min(at + 1, rest_.size()));
    return text;
  }

  std::string_view rest_;
};

class Reader {
 public:
  explicit Reader(const std::string& text) : tokens_(text) {}

  UsdStage read() {
    if (!tokens_.next_is("#usda 1.0\n")) throw std::runtime_error("no USDA");
    for (int n = 0; n < 2; ++n) tokens_.take();
    read_head();
    tokens_.expect("def");
    tokens_.expect("Xform");
    if (tokens_.take() != stage_.default_prim) throw std::runtime_error("another default prim");
    expect_all({"(", "kind", "=", "component", ")", "{"});
    while (!tokens_.next_is("}")) {
      tokens_.expect("def");
      tokens_.next_is("Material") ? read_material() : read_mesh();
    }
    tokens_.expect("}");
    if (!tokens_.is_over()) throw std::runtime_error("more after the stage");
    return stage_;
  }

 private:
  void expect_all(std::initializer_list<std::string_view> all) {
    for (const std::string_view token : all) tokens_.expect(token);
  }

  void read_head() {
    expect_all({"(", "customLayerData", "=", "{", "string", "isomesh:provenance", "="});
    stage_.provenance = tokens_.take();
    expect_all({"}", "defaultPrim", "="});
    stage_.default_prim = tokens_.take();
    expect_all({"metersPerUnit", "="});
    stage_.metres_per_unit = tokens_.number<double>();
    expect_all({"upAxis", "="});
    stage_.up_axis = tokens_.take();
    tokens_.expect(")");
  }

  void read_material() {
    tokens_.expect("Material");
    const std::string path = "/isomesh/" + tokens_.take();
    expect_all({"{", "token", "outputs:surface.connect", "="});
    tokens_.expect('<' + path + "/shader.outputs:surface>");
    expect_all({"def", "Shader", "shader", "{", "uniform", "token", "info:id", "=",
                "UsdPreviewSurface", "color3f", "inputs:diffuseColor", "="});
    materials_['<' + path + '>'] = tokens_.vector();
    expect_all({"float", "inputs:metallic", "=", "0", "float", "inputs:roughness", "=", "0.6",
                "token", "outputs:surface", "}", "}"});
  }

  void read_mesh() {
    UsdMesh& mesh = stage_.meshes.emplace_back();
    tokens_.expect("Mesh");
    mesh.prim = tokens_.take();
    tokens_.expect("(");
    if (tokens_.next_is("customData")) {
      expect_all({"customData", "=", "{", "int64", "label", "="});
      mesh.label = tokens_.number<std::int64_t>();
      expect_all({"}", "displayName", "="});
      mesh.title = tokens_.take();
    }
    expect_all({"prepend", "apiSchemas", "=", "[", "MaterialBindingAPI", "]", ")", "{", "uniform",
                "token", "subdivisionScheme", "=", "none", "rel", "material:binding", "="});
    mesh.material_color = materials_.at(tokens_.take());
    const auto vector = [&] { return tokens_.vector(); };
    const auto index = [&] { return tokens_.number<std::uint32_t>(); };
    expect_all({"color3f[]", "primvars:displayColor", "="});
    mesh.color = tokens_.array(vector).at(0);
    expect_all({"float3[]", "extent", "="});
    mesh.extent = tokens_.array(vector);
    expect_all({"point3f[]", "points", "="});
    mesh.points = tokens_.array(vector);
    if (tokens_.next_is("normal3f")) {
      expect_all({"normal3f[]", "normals", "="});
      mesh.normals = tokens_.array(vector);
      expect_all({"(", "interpolation", "=", "vertex", ")"});
    }
    expect_all({"int[]", "faceVertexCounts", "="});
    const auto counts = tokens_.array(index);
    expect_all({"int[]", "faceVertexIndices", "="});
    const auto indices = tokens_.array(index);
    tokens_.expect("}");
    if (indices.size() != 3 * counts.size()) throw std::runtime_error("faces and corners differ");
    for (std::size_t t = 0; t < counts.size(); ++t) {
      if (counts[t] != 3) throw std::runtime_error("a face has not three corners");
      mesh.triangles.push_back({indices[3 * t], indices[3 * t + 1], indices[3 * t + 2]});
    }
  }

  Tokens tokens_;
  UsdStage stage_;
  std::map<std::string, mesh::Vec3> materials_;
};

}  // namespace

UsdStage read_usda(const std::string& text) { return Reader(text).read(); }

std::string first_file_of_usdz(const std::string& bytes) {
  const auto number = [&](std::size_t at, std::size_t size) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.substr(at, size).data(), size);
    return value;
  };
  constexpr std::size_t kHeader = 30;
  if (bytes.size() < kHeader || !bytes.starts_with("PK\3\4") || number(6, 2) != 0 ||
      number(8, 2) != 0) {
    throw std::runtime_error("no ZIP, or not stored");
  }
  const std::size_t name = number(26, 2);
  const std::size_t begin = kHeader + name + number(28, 2);
  if (!bytes.substr(kHeader, name).ends_with(".usda")) throw std::runtime_error("no USDA");
  if (begin % 64 != 0) throw std::runtime_error("the file is not aligned");
  return bytes.substr(begin, number(18, 4));
}

}  // namespace isomesh::test
