#include "tests/support/draco_decoder.h"

#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::test {
namespace {

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}

  template <class T>
  T next() {
    T value;
    if (bytes_.size() < sizeof value) throw std::runtime_error("the PLY file is too short");
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }

  bool at_end() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
};

// The counts in a header with exactly the properties below; the command writes no others.
struct Header {
  std::size_t bytes = 0;
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

Header header_of(const std::string& ply) {
  constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = ply.find(kEnd);
  if (end == std::string::npos) throw std::runtime_error("the PLY file has no header");
  Header header;
  header.bytes = end + kEnd.size();
  std::istringstream lines(ply.substr(0, end));
  std::string rest;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("element vertex ")) header.vertices = std::stoull(line.substr(15));
    if (line.starts_with("element face ")) header.faces = std::stoull(line.substr(13));
    if (line.starts_with("property") || line.starts_with("format")) rest += line + '\n';
  }
  const bool has_faces = rest.find("vertex_indices") != std::string::npos;
  if (rest != std::string("format binary_little_endian 1.0\nproperty float x\nproperty float y\n"
                          "property float z\n") +
                  (has_faces ? "property list uchar int vertex_indices\n" : "")) {
    throw std::runtime_error("the PLY file has another layout: " + rest);
  }
  return header;
}

DecodedMesh parse_ply(const std::string& ply) {
  const Header header = header_of(ply);
  Reader reader(std::string_view(ply).substr(header.bytes));
  DecodedMesh mesh;
  for (std::size_t vertex = 0; vertex < header.vertices; ++vertex) {
    auto& point = mesh.points.emplace_back();
    for (float& coordinate : point) coordinate = reader.next<float>();
  }
  for (std::size_t face = 0; face < header.faces; ++face) {
    if (reader.next<std::uint8_t>() != 3) throw std::runtime_error("a face is no triangle");
    auto& triangle = mesh.triangles.emplace_back();
    for (std::uint32_t& index : triangle) index = reader.next<std::uint32_t>();
  }
  if (!reader.at_end()) throw std::runtime_error("the PLY file goes on behind its mesh");
  return mesh;
}

}  // namespace

DecodedMesh decode_with_command(std::string_view drc) {
  const TemporaryFolder folder;
  write_file(folder / "mesh.drc", drc);
  const Finished result =
      run({"draco_decoder", "-i", folder / "mesh.drc", "-o", folder / "mesh.ply"});
  if (result.status != 0) {
    throw std::runtime_error("draco_decoder: " + result.output + result.errors);
  }
  return parse_ply(read_file(folder / "mesh.ply"));
}

}  // namespace isomesh::test
