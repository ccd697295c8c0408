// The quality of a mesh's triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Up to this many triangles, all are measured. Of more, every n-th run of 256 triangles is
// measured, about half as many triangles in total: more would hardly change a mean and take as long
// as extraction. The sums of the histograms tell how many were measured.
inline constexpr std::size_t kMostMeasuredTriangles = std::size_t{1} << 20;

// The measures of a triangle, in single precision:
//  * its radius ratio, twice the radius of the inscribed circle over that of the circumscribed one:
//    1 when it is equilateral, 0 when it is flat (P. P. Pébay, T. J. Baker, "Analysis of triangle
//    quality measures", Math. Comp. 72, 2003);
//  * its smallest angle in degrees, at most 60.
struct Shapes {
  Distribution aspect_ratio;        // bins of 0.05
  Distribution smallest_angle_deg;  // bins of 3 degrees
};

// Does not depend on the number of threads or the processor. Throws Error kCancelled.
Shapes measure_shapes(const Mesh& mesh, const Context& context);

// The same of a surface of that many triangles that are seen a few at a time, in their order.
class ShapesSum {
 public:
  explicit ShapesSum(std::uint64_t triangles);
  ~ShapesSum();

  // The triangles [begin, end) of the mesh are the surface's next.
  void add(const Mesh& mesh, std::size_t begin, std::size_t end);
  Shapes result() const;

 private:
  struct Sums;
  std::unique_ptr<Sums> sums_;
};

}  // namespace isomesh::mesh
