#include <vector>

#include "server/codec/decode/formats.h"
#include "server/codec/decode/lines.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

enum class Kind { kVertex, kFace, kOther };

Kind kind_of(std::string_view line) {
  if (line.starts_with("v ")) return Kind::kVertex;
  if (line.starts_with("f ")) return Kind::kFace;
  const bool is_known = line.empty() || line.starts_with('#') || line.starts_with("g ");
  if (!is_known) refuse(MeshFormat::kObj, "a line begins with \"" + std::string(line, 0, 8) + "\"");
  return Kind::kOther;
}

// Some whole lines of the file, and where what is in them belongs.
struct Piece {
  std::string_view text;
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

void count(Piece& piece) {
  for_each_line(piece.text, [&](std::string_view line) {
    const Kind kind = kind_of(line);
    piece.vertices += kind == Kind::kVertex ? 1 : 0;
    piece.faces += kind == Kind::kFace ? 1 : 0;
  });
}

void read(const Piece& piece, mesh::Vec3* position, mesh::Triangle* triangle) {
  for_each_line(piece.text, [&](std::string_view line) {
    if (line.starts_with("v "))
      *position++ = numbers_of<float, 3>(line.substr(2), MeshFormat::kObj);
    if (!line.starts_with("f ")) return;
    *triangle = numbers_of<std::uint32_t, 3>(line.substr(2), MeshFormat::kObj);
    for (std::uint32_t& vertex : *triangle) {
      if (vertex == 0) refuse(MeshFormat::kObj, "a face names vertex 0, but the first vertex is 1");
      --vertex;
    }
    ++triangle;
  });
}

}  // namespace

DecodedSurface decode_obj(Bytes file, const mesh::Context& context) {
  const mesh::Context quiet = {context.stop, nullptr};
  std::vector<Piece> pieces;
  for (const std::string_view text : cut_lines(as_text(file))) pieces.push_back({.text = text});
  mesh::parallel_for(quiet, pieces.size(), [&](std::size_t n) { count(pieces[n]); });
  std::vector<std::size_t> vertices = {0};
  std::vector<std::size_t> faces = {0};
  for (const Piece& piece : pieces) {
    vertices.push_back(vertices.back() + piece.vertices);
    faces.push_back(faces.back() + piece.faces);
  }
  DecodedSurface surface;
  surface.positions.resize_for_overwrite(vertices.back());
  surface.triangles.resize_for_overwrite(faces.back());
  mesh::parallel_for(quiet, pieces.size(), [&](std::size_t n) {
    read(pieces[n], surface.positions.begin() + vertices[n], surface.triangles.begin() + faces[n]);
  });
  return surface;
}

}  // namespace isomesh::codec::decoding
