#include <algorithm>
#include <charconv>
#include <system_error>
#include <vector>

#include "server/codec/decode/formats.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::size_t kBytesPerTask = std::size_t{1} << 20;

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

  template <class Visit>
  void for_each_line(const Visit& visit) const {
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      visit(text.substr(at, end - at));
      at = end + 1;
    }
  }
};

std::vector<Piece> cut(std::string_view text) {
  std::vector<Piece> pieces;
  while (!text.empty()) {
    std::size_t end = text.size();
    if (end > kBytesPerTask) end = std::min(text.find('\n', kBytesPerTask), end - 1) + 1;
    pieces.push_back({.text = text.substr(0, end)});
    text.remove_prefix(end);
  }
  return pieces;
}

// The three numbers behind the line's first letter.
template <class T>
std::array<T, 3> numbers_of(std::string_view line) {
  std::array<T, 3> numbers;
  const char* at = line.data() + 1;
  const char* const end = line.data() + line.size();
  for (T& number : numbers) {
    const bool is_behind_blank = at != end && *at == ' ';
    const auto [next, error] = std::from_chars(is_behind_blank ? at + 1 : end, end, number);
    if (error != std::errc{}) {
      refuse(MeshFormat::kObj, "there are no three numbers in \"" + std::string(line) + "\"");
    }
    at = next;
  }
  if (at != end) refuse(MeshFormat::kObj, "something follows \"" + std::string(line) + "\"");
  return numbers;
}

void count(Piece& piece) {
  piece.for_each_line([&](std::string_view line) {
    const Kind kind = kind_of(line);
    piece.vertices += kind == Kind::kVertex ? 1 : 0;
    piece.faces += kind == Kind::kFace ? 1 : 0;
  });
}

void read(const Piece& piece, mesh::Vec3* position, mesh::Triangle* triangle) {
  piece.for_each_line([&](std::string_view line) {
    if (line.starts_with("v ")) *position++ = numbers_of<float>(line);
    if (!line.starts_with("f ")) return;
    *triangle = numbers_of<std::uint32_t>(line);
    for (std::uint32_t& vertex : *triangle) {
      if (vertex == 0) refuse(MeshFormat::kObj, "a face names vertex 0, and the first is 1");
      --vertex;
    }
    ++triangle;
  });
}

}  // namespace

DecodedSurface decode_obj(Bytes file, const mesh::Context& context) {
  const mesh::Context quiet = {context.stop, nullptr};
  std::vector<Piece> pieces = cut(as_text(file));
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
