#include "tests/unit/codec/foreign_cgal.h"

#include <sstream>
#include <stdexcept>
#include <vector>

#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/Simple_cartesian.h>

namespace isomesh::test {

DecodedMesh read_with_cgal(const std::string& bytes, MeshFormat format) {
  std::vector<CGAL::Simple_cartesian<double>::Point_3> points;
  std::vector<std::vector<std::size_t>> polygons;
  std::istringstream stream(bytes);
  const bool is_read = format == MeshFormat::kObj ? CGAL::IO::read_OBJ(stream, points, polygons)
                                                  : CGAL::IO::read_OFF(stream, points, polygons);
  if (!is_read) throw std::runtime_error("CGAL does not read the file");
  DecodedMesh mesh;
  for (const auto& point : points) {
    mesh.points.push_back({static_cast<float>(point.x()), static_cast<float>(point.y()),
                           static_cast<float>(point.z())});
  }
  for (const auto& polygon : polygons) {
    if (polygon.size() != 3) throw std::runtime_error("a face has not three corners");
    auto& triangle = mesh.triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      triangle[corner] = static_cast<std::uint32_t>(polygon[corner]);
    }
  }
  return mesh;
}

}  // namespace isomesh::test
