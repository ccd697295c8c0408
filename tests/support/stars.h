// The neighbours of samples, gathered from the tetrahedra themselves, and sets of them.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "tests/support/tetrahedra.h"

namespace isomesh::test {

using Samples = std::set<Sample>;

// The neighbours of one sample, and of each of them those that are neighbours of both: its ring.
using Star = std::map<Sample, Samples>;

using Stars = std::map<Sample, Star>;

// Makes the corners neighbours of each other, around each of them.
void add_to_stars(std::span<const Sample, 4> corners, Stars& stars);

// Those of all samples of a lattice of five or six tetrahedra. Most tests ask for a few again and
// again.
const Stars& stars_of(const mesh::Dims& dims, Scheme scheme, std::uint32_t margin);

// z first, as samples are stored.
bool is_before(const Sample& a, const Sample& b);

bool is_connected(const Star& star, const Samples& all);

std::vector<Samples> components_of(const Star& star, Samples all);

Samples common(const Samples& a, const Samples& b);

// True if `some`, which are not all neighbours, leave neighbours that are connected.
bool leaves_connected(const Star& star, const Samples& some);

// True if `some` of the ring around a neighbour are none, or one run with two others left.
bool is_run(const Star& star, const Samples& ring, const Samples& some);

}  // namespace isomesh::test
