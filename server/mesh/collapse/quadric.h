// Squared distances from the planes around a vertex; private to this folder.
#pragma once

#include <cmath>

#include "server/mesh/collapse/vec.h"

namespace isomesh::mesh::collapse {

// d' A d + 2 b d + c of the way d from the vertex.
struct Quadric {
  float a00 = 0, a01 = 0, a02 = 0, a11 = 0, a12 = 0, a22 = 0;
  Vecf b;
  float c = 0;
  float weight = 0;

  // The quadric of a plane through the vertex; the normal's length is its weight.
  static Quadric of_plane(Vecf normal) {
    const float weight = length(normal);
    if (!(weight > 0)) return {};
    const Vecf unit = normal * (1 / weight);
    return {normal.x * unit.x,
            normal.x * unit.y,
            normal.x * unit.z,
            normal.y * unit.y,
            normal.y * unit.z,
            normal.z * unit.z,
            {},
            0,
            weight};
  }

  Vecf times(Vecf d) const {
    return {a00 * d.x + a01 * d.y + a02 * d.z, a01 * d.x + a11 * d.y + a12 * d.z,
            a02 * d.x + a12 * d.y + a22 * d.z};
  }
  float at(Vecf d) const { return std::abs(dot(d, times(d) + b * 2.0F) + c); }
  // The same about the place at `d`.
  Quadric about(Vecf d) const {
    Quadric moved = *this;
    const Vecf product = times(d);
    moved.c += dot(d, product + b * 2.0F);
    moved.b = b + product;
    return moved;
  }
  friend Quadric operator+(Quadric p, const Quadric& q) {
    p.a00 += q.a00;
    p.a01 += q.a01;
    p.a02 += q.a02;
    p.a11 += q.a11;
    p.a12 += q.a12;
    p.a22 += q.a22;
    p.b = p.b + q.b;
    p.c += q.c;
    p.weight += q.weight;
    return p;
  }

  // The way to where it is least, held back a little where it hardly changes; none where that is
  // farther than `most`.
  Vecf least(float most) const {
    const float hold = 0.003F * (a00 + a11 + a22) + 1e-12F;
    const float p = a00 + hold;
    const float q = a11 + hold;
    const float r = a22 + hold;
    const Vecf row = {q * r - a12 * a12, a02 * a12 - a01 * r, a01 * a12 - a02 * q};
    const float determinant = dot({p, a01, a02}, row);
    if (!(determinant > 0)) return {};
    const float cross12 = a01 * a02 - p * a12;
    const Vecf way = Vecf{dot(row, b), dot({row.y, p * r - a02 * a02, cross12}, b),
                          dot({row.z, cross12, p * q - a01 * a01}, b)} *
                     (-1 / determinant);
    return length(way) > most ? Vecf{} : way;
  }
};

}  // namespace isomesh::mesh::collapse
