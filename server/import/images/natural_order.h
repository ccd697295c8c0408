// The order of numbered files.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

// True if `one` comes first, with numbers in the names compared by value: "a9.png" before
// "a10.png".
bool comes_before(std::string_view one, std::string_view other);

// The first name that is missing in the sorted names, if these differ in one number only, which
// grows by a constant step otherwise. Empty if none is missing.
std::string missing_between(const std::vector<std::string>& sorted);

// The name with "*" for each number, which may have a fraction and a minus: "a-1.5_b2" is "a*_b*".
std::string name_pattern(std::string_view name);

// The indexes of the names of slices from the first slice to the last. Throws Error kUnusableVolume
// if a whole number is missing, or the numbers allow several orders.
std::vector<std::size_t> slice_order(const std::vector<std::string>& names);

// The names of a folder's images as indexes.
struct NameGroups {
  std::vector<std::vector<std::size_t>> volumes;
  std::vector<std::size_t> others;  // without the number that the slices have
};

// Names that differ in more than their numbers are those of several volumes if each has numbers of
// the largest. In doubt all are one volume.
NameGroups groups_of(const std::vector<std::string>& names);

}  // namespace isomesh::import
