// Numbers, words and vectors in the fields of an NRRD header. Internal to the reader. All throw
// Error kUnusableVolume that names the field.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "server/import/formats/nrrd_space.h"

namespace isomesh::import {

// What is not told, which the format calls "nan" or "none".
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

inline bool is_known(double number) { return !std::isnan(number); }

[[noreturn]] void throw_not_understood(std::string_view name, std::string_view value);

// One finite or unknown number for each of `axes` axes; all are unknown without the field.
std::vector<double> axis_numbers(const NrrdFields& fields, std::string_view name, std::size_t axes);

// One word for each axis; none without the field.
std::vector<std::string_view> axis_words(const NrrdFields& fields, std::string_view name,
                                         std::size_t axes);

// Takes the spaces off the front of `rest`.
void skip_spaces(std::string_view& rest);

// Takes "(x,y,z)", or "none", off the front of `rest`. Empty when there is neither.
std::optional<std::vector<double>> take_vector(std::string_view& rest, std::size_t size);

}  // namespace isomesh::import
