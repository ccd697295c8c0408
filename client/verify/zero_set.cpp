// Marching tetrahedra, a layer of cells after the other.
#include <algorithm>
#include <cmath>
#include <limits>

#include "client/verify/field.h"

namespace isomesh::verify {
namespace {

constexpr double kFarBelow = -std::numeric_limits<double>::infinity();
constexpr std::uint32_t kNone = UINT32_MAX;

// Corners of a cell are 0..7; their bits are the offsets along x, y and z.
using Tetrahedron = std::array<unsigned, 4>;

std::vector<Tetrahedron> split(int tetrahedra, bool odd) {
  if (tetrahedra == 6) {  // along the diagonal 0-7: one for each order of the axes
    return {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
  }
  if (odd) return {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}};
  return {{0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}};
}

class March {
 public:
  March(const Field& field, const Cut& cut) : field_(field), cut_(cut), pad_(cut.close ? 1 : 0) {
    nx_ = field.dims[0] + 2 * pad_;
    ny_ = field.dims[1] + 2 * pad_;
    nz_ = field.dims[2] + 2 * pad_;
  }

  Surface run() {
    const std::array<std::vector<Tetrahedron>, 2> splits = {split(cut_.tetrahedra, false),
                                                            split(cut_.tetrahedra, true)};
    load(0);
    for (k_ = 0; k_ + 1 < nz_; ++k_) {
      load(k_ + 1);
      for (j_ = 0; j_ + 1 < ny_; ++j_) {
        for (i_ = 0; i_ + 1 < nx_; ++i_) {
          unsigned inside = 0;
          for (unsigned c = 0; c < 8; ++c) inside |= value(c) >= 0 ? 1U << c : 0;
          if (inside == 0 || inside == 255) continue;
          // The parity is that of the volume's own indices.
          for (const Tetrahedron& t : splits[static_cast<std::size_t>((i_ + j_ + k_ + pad_) & 1)])
            cut(t, inside);
        }
      }
    }
    return std::move(surface_);
  }

 private:
  struct Layer {
    std::vector<double> values;
    std::vector<std::array<std::uint32_t, 8>> points;  // of the edges that a sample owns
  };

  std::size_t at(unsigned corner) const {
    return static_cast<std::size_t>((j_ + (corner >> 1 & 1)) * nx_ + i_ + (corner & 1));
  }
  Layer& layer(unsigned corner) {
    return layers_[static_cast<std::size_t>((k_ + (corner >> 2)) & 1)];
  }
  double value(unsigned corner) { return layer(corner).values[at(corner)]; }
  Vec index(unsigned corner) const {
    return {static_cast<double>(i_ - pad_ + (corner & 1)),
            static_cast<double>(j_ - pad_ + (corner >> 1 & 1)),
            static_cast<double>(k_ - pad_ + (corner >> 2))};
  }

  // Reads the samples of plane k, whose edges have no points yet.
  void load(std::int64_t k) {
    Layer& layer = layers_[static_cast<std::size_t>(k & 1)];
    layer.values.assign(static_cast<std::size_t>(nx_ * ny_), kFarBelow);
    layer.points.assign(layer.values.size(),
                        {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone});
    if (k < pad_ || k >= nz_ - pad_) return;
    for (std::int64_t j = pad_; j < ny_ - pad_; ++j) {
      for (std::int64_t i = pad_; i < nx_ - pad_; ++i) {
        const double f =
            field_.samples[static_cast<std::size_t>(
                ((k - pad_) * field_.dims[1] + j - pad_) * field_.dims[0] + i - pad_)] -
            cut_.iso;
        layer.values[static_cast<std::size_t>(j * nx_ + i)] = !cut_.midpoint ? f : f >= 0 ? 1 : -1;
      }
    }
  }

  // The point where F is zero between an inside and an outside corner.
  std::uint32_t crossing(unsigned inside, unsigned outside) {
    const unsigned owner = inside & outside;
    std::uint32_t& number = layer(owner).points[at(owner)][inside ^ outside];
    if (number == kNone) {
      number = static_cast<std::uint32_t>(surface_.points.size());
      const double share = value(inside) / (value(inside) - value(outside));
      surface_.points.push_back(
          field_.place(index(inside) + share * (index(outside) - index(inside))));
    }
    return number;
  }

  void cut(const Tetrahedron& corners, unsigned inside) {
    std::array<std::array<unsigned, 4>, 2> sides = {};  // outside, inside
    std::array<std::size_t, 2> counts = {0, 0};
    std::array<Vec, 2> sums = {};
    for (const unsigned corner : corners) {
      const std::size_t side = inside >> corner & 1;
      sides[side][counts[side]++] = corner;
      sums[side] = sums[side] + field_.place(index(corner));
    }
    if (counts[0] == 0 || counts[1] == 0) return;
    const auto& [out, in] = sides;
    const Vec outward = 1.0 / static_cast<double>(counts[0]) * sums[0] -
                        1.0 / static_cast<double>(counts[1]) * sums[1];
    if (counts[1] == 1)
      return add({crossing(in[0], out[0]), crossing(in[0], out[1]), crossing(in[0], out[2])},
                 outward);
    if (counts[0] == 1)
      return add({crossing(in[0], out[0]), crossing(in[1], out[0]), crossing(in[2], out[0])},
                 outward);
    const std::uint32_t one = crossing(in[0], out[0]);
    const std::uint32_t other = crossing(in[1], out[1]);
    add({one, crossing(in[0], out[1]), other}, outward);
    add({one, other, crossing(in[1], out[0])}, outward);
  }

  void add(std::array<std::uint32_t, 3> triangle, const Vec& outward) {
    surface_.triangles.push_back(triangle);
    if (dot(normal_of(surface_.corners(surface_.triangles.size() - 1)), outward) < 0)
      std::swap(surface_.triangles.back()[1], surface_.triangles.back()[2]);
  }

  const Field& field_;
  const Cut cut_;
  const std::int64_t pad_;
  std::int64_t nx_ = 0, ny_ = 0, nz_ = 0;
  std::int64_t i_ = 0, j_ = 0, k_ = 0;  // the cell
  std::array<Layer, 2> layers_;
  Surface surface_;
};

}  // namespace

Surface zero_set(const Field& field, const Cut& cut) { return March(field, cut).run(); }

}  // namespace isomesh::verify
