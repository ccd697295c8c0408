// Numbers, words and vectors in the fields of an NRRD header. Internal to the reader. All functions
// throw Error kUnusableVolume with the field's name.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "server/import/formats/nrrd_space.h"

namespace isomesh::import {

// An unknown number, "nan" or "none" in the format.
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

inline bool is_known(double number) { return !std::isnan(number); }

[[noreturn]] void throw_not_understood(std::string_view name, std::string_view value);

// One finite or unknown number per axis; all are unknown without the field.
std::vector<double> axis_numbers(const NrrdFields& fields, std::string_view name, std::size_t axes);

// One word per axis; empty without the field.
std::vector<std::string_view> axis_words(const NrrdFields& fields, std::string_view name,
                                         std::size_t axes);

void skip_spaces(std::string_view& rest);

// Removes "(x,y,z)" or "none" from the front of `rest`. Empty if there is neither.
std::optional<std::vector<double>> take_vector(std::string_view& rest, std::size_t size);

}  // namespace isomesh::import
